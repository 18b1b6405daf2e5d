"""Irregularities of a recording, in sentences: its clock, missing, duplicate or too few scans, foreign poses."""

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.scan import Array, Sequence
from automos.odometry.clock import GAP, USUAL_PERIOD

USUAL_RATE = 1.0 / USUAL_PERIOD
NEAREST, FARTHEST = 0.15, 10.0
"""Seconds between a scan and those that can show what moved: the spans of the evidence, with their tolerance."""
ENOUGH = 8
"""Such scans that it takes: with fewer, what drives and rides past in the open is not found reliably."""


def recording_warnings(sequence: Sequence, rate: float | None = None) -> list[str]:
    """Return what a reader of labels of `sequence` should know of the recording; nothing where it is regular.

    `rate` : scans a second of a recording without times, if known.
    """
    return [
        *sequence.warnings,
        *_assumed(sequence, rate),
        *_few(sequence, rate),
        *_doubled(sequence),
        *([] if sequence.stamps is None else _missing(sequence.stamps, sequence.names)),
        *_foreign_poses(sequence),
    ]


def scan_rate(sequence: Sequence, rate: float | None = None) -> dict[str, float | str]:
    """Return how many scans a second there usually are, `rate` without times, and how that is known."""
    if sequence.stamps is not None and len(sequence.stamps) > 1:
        usual = float(np.median(np.diff(sequence.stamps)))
        return {"rate_hz": round(1.0 / max(usual, 1e-9), 3), "rate_from": "times"}
    return {"rate_hz": rate or USUAL_RATE, "rate_from": "assumed" if rate is None else "given"}


def _assumed(sequence: Sequence, rate: float | None) -> list[str]:
    """Where nothing tells the time, speeds are a guess."""
    if sequence.stamps is not None or rate is not None or len(sequence) < 2:
        return []
    return [f"No scan has a time: {USUAL_RATE:g} scans a second are assumed. If it is another number, give --rate HZ."]


def _few(sequence: Sequence, rate: float | None) -> list[str]:
    """Where hardly another scan can be asked about a scan, nothing moving is not a finding."""
    n = len(sequence)
    stamps = np.arange(n) / (rate or USUAL_RATE) if sequence.stamps is None else sequence.stamps
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


def _missing(stamps: Array, names: list[str]) -> list[str]:
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
