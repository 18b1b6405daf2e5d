"""Scan rates too low for tracking: the evidence alone decides, scan by scan.

At one or two scans per second a car advances by more than its own length between scans, so any car of the lane may be
associated with it. But an object whose place was observed free before and after has moved. Tracks would only add
errors: they associate different objects and predict them at places that nothing passed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.scan import Mask

LONGEST_STEP = 0.4
"""Seconds between scans from which on there is no tracking: a car of four metres at 10 m/s has left its place."""
_MIN_SHARE = 0.5
_MIN_MOVED = 5
_MAX_LIFT = 2.5
"""Limits for a moving segment: least share and number of moved points, and greatest height of its lowest, metres."""


def can_follow(stamps: npt.NDArray[np.float64]) -> bool:
    """Return whether the rate of scans at `stamps` (N,), seconds, is high enough for tracking."""
    return len(stamps) < 2 or float(np.median(np.diff(stamps))) < LONGEST_STEP


def find_moved(ids: npt.NDArray[np.int32], found: Detections) -> Mask:
    """Return (M,) bool: points of one scan in segments, `ids` (M,) of `found`, that consist mostly of moved points."""
    moves = (found.n_moving >= np.maximum(_MIN_SHARE * found.n_points, _MIN_MOVED)) & (found.lift <= _MAX_LIFT)
    return np.append(moves & ~found.has_stayed, False)[ids]  # the last entry is for id -1
