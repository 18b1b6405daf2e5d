"""An error in the elevation of all beams: they point higher or lower than the sensor's own table says.

A place is then seen at another height from far than from near, which bends the path of a sensor that drives.
"""

from dataclasses import replace

import numpy as np

from automos.core.scan import MIN_RANGE, Points, Scan, Sequence
from automos.core.views import View


def raised(points: Points, angle: float) -> Points:
    """Return `points` (N, 3) of one LiDAR, in its own frame, as if its beams pointed `angle` radians higher."""
    if angle == 0.0:
        return points
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    x, y, z = points.T
    level = np.hypot(x, y)
    with np.errstate(invalid="ignore", over="ignore"):
        shrunk = c - s * z / np.maximum(level, np.float32(MIN_RANGE))
        return np.stack([x * shrunk, y * shrunk, c * z + s * level], axis=1)


def raised_scan(scan: Scan, angle: float) -> Scan:
    """Return `scan` of one LiDAR as if its beams pointed `angle` radians higher."""
    return scan if angle == 0.0 else replace(scan, points=raised(scan.points, angle))


class Raised(View):
    """The recording as if all beams of its LiDAR pointed `angle` radians higher."""

    def __init__(self, sequence: Sequence, angle: float):
        """Take a recording of one LiDAR."""
        super().__init__(sequence)
        self._angle = angle

    def __getitem__(self, index: int) -> Scan:
        return raised_scan(super().__getitem__(index), self._angle)
