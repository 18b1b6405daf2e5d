"""Scans too far apart to follow anything from one to the next: the evidence alone decides, scan by scan.

At one or two scans a second a car advances by more than its own length between scans, and any car of the lane may be
taken for the one before. But what was seen to be empty before and after, and was taken in between, has moved. Tracks
would only spoil that: they join what does not belong together and carry the join to places that nothing passed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.scan import Mask

LONGEST_STEP = 0.4
"""Seconds between scans from which on nothing is followed: a car of four metres at 10 m/s has left its place."""
_MIN_SHARE = 0.5
_MIN_MOVED = 5
_MAX_LIFT = 2.5
"""Of a segment that moves: share and number of points that have moved, and metres from the ground to its lowest one."""


def can_follow(stamps: npt.NDArray[np.float64]) -> bool:
    """Return whether scans at `stamps` (N,) seconds follow each other fast enough for tracks."""
    return len(stamps) < 2 or float(np.median(np.diff(stamps))) < LONGEST_STEP


def find_moved(ids: npt.NDArray[np.int32], found: Detections) -> Mask:
    """Return (M,) bool: which of one scan's points lie in a segment, `ids` (M,) of `found`, most of which has moved."""
    moves = (found.n_moving >= np.maximum(_MIN_SHARE * found.n_points, _MIN_MOVED)) & (found.lift <= _MAX_LIFT)
    return np.append(moves & ~found.has_stayed, False)[ids]  # the last entry is for id -1
