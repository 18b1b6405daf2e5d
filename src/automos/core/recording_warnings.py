"""Irregularities of a recording, in sentences: its clock, missing, duplicate or too few scans, foreign poses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.scan import Sequence

GAP = 1.5
"""Times the usual step of the clock from which scans are missing."""
NEAREST, FARTHEST = 0.15, 10.0
"""Seconds between a scan and those that can show what moved: the spans of the evidence, with their tolerance."""
ENOUGH = 8
"""Such scans that it takes: with fewer, what drives and rides past in the open is not found reliably."""
USUAL_PERIOD = 0.1
"""Seconds between scans where the recording has no clock."""


def recording_warnings(sequence: Sequence) -> list[str]:
    """Return what a reader of labels of `sequence` should know of the recording; nothing where it is regular."""
    return [
        *sequence.warnings,
        *_few(sequence),
        *_doubled(sequence),
        *([] if sequence.stamps is None else _missing(sequence.stamps, sequence.names)),
        *_foreign_poses(sequence),
    ]


def _few(sequence: Sequence) -> list[str]:
    """Where hardly another scan can be asked about a scan, nothing moving is not a finding."""
    n = len(sequence)
    stamps = USUAL_PERIOD * np.arange(n) if sequence.stamps is None else sequence.stamps
    asked = np.array(evenly_spread(stamps, 50))  # all pairs of scans would fill the memory
    apart = np.abs(asked[:, None] - stamps[None])
    others = int(np.median(((apart >= NEAREST) & (apart <= FARTHEST)).sum(axis=1))) if n else 0
    if others >= ENOUGH:
        return []
    lasting = float(np.ptp(stamps)) if n else 0.0
    few = f"{n} scan over" if n == 1 else f"{n} scans over"
    return [
        f"{few} {lasting:.2g} s {'is' if n == 1 else 'are'} too few to decide what moves: a scan is compared with "
        f"others {NEAREST:g} to {FARTHEST:g} s before and after it, of which there are {others} here and should be "
        f"{ENOUGH} or more. What is not called moving may move all the same: give more of the recording."
    ]


def _doubled(sequence: Sequence) -> list[str]:
    repeats = sequence.repeats
    if repeats is None or not repeats.any():
        return []
    first = int(np.argmax(repeats))
    return [f"{int(repeats.sum())} scans are the one before them once more (first: {sequence.names[first]})."]


def _missing(stamps: npt.NDArray[np.float64], names: list[str]) -> list[str]:
    steps = np.diff(stamps)
    if len(steps) < 2:
        return []
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    if not len(gaps):
        return []
    longest = gaps[steps[gaps].argmax()]
    missing = int(np.round(steps[gaps] / usual - 1.0).sum())
    return [
        f"About {missing} scans are missing in {len(gaps)} places; the longest gap is {steps[longest]:.2f} s, after "
        f"scan {names[longest]}. Labels near gaps rest on less evidence."
    ]


def _foreign_poses(sequence: Sequence) -> list[str]:
    """Labels need no poses that come with a recording; but poses that do not fit say that something is mixed up."""
    try:
        _ = sequence.reference_poses
    except InputError as error:
        return [f"The poses that come with the recording do not fit it and are not used: {error}"]
    return []
