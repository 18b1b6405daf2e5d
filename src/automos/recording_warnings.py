"""What is irregular about a recording, in sentences: its clock, scans that are missing or doubled, poses of another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.scan import Sequence

GAP = 1.5
"""Times the usual step of the clock from which scans are missing."""


def recording_warnings(sequence: Sequence) -> list[str]:
    """Return what a reader of labels of `sequence` should know of the recording; nothing where it is regular."""
    return [
        *sequence.warnings,
        *_doubled(sequence),
        *([] if sequence.stamps is None else _missing(sequence.stamps, sequence.names)),
        *_foreign_poses(sequence),
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
