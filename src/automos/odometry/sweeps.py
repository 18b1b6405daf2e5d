"""The points of a scan that a registration can use, moved to mid-sweep."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from automos.odometry.motion import SweepTiming, compensate, sweep_times
from automos.odometry.surfels import MIN_SURFEL_POINTS, Surfels, make_surfels
from automos.scan import MIN_RANGE, Points, Scan
from automos.settings import OdometrySettings

MIN_POINTS = 50
"""Usable points of a scan without which it is not registered, and asked about no ground."""


def usable_points(
    scan: Scan, timing: SweepTiming, twist: npt.NDArray[np.float64], settings: OdometrySettings
) -> tuple[Points, npt.NDArray[np.float32] | None]:
    """Return the valid points in range (M, 3), compensated for `twist` (6,), and their times (M,) or None."""
    rows = rows_in_range(scan, settings)
    points, times = np.take(scan.points, rows, axis=0), sweep_times(scan, timing)  # [rows] takes five times as long
    if times is None:
        return points, None
    times = np.take(times, rows)
    return compensate(points, times, twist), times


def rows_in_range(scan: Scan, settings: OdometrySettings) -> npt.NDArray[np.int32]:
    """Return (M,) the rows of the points that a registration can use."""
    return _rows_in_range(scan.points, max(settings.min_range, MIN_RANGE), settings.max_range)


@numba.njit(cache=True, nogil=True)
def _rows_in_range(points, nearest, farthest):  # type: ignore[no-untyped-def]
    rows = np.empty(len(points), np.int32)
    n = 0
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        squared = x * x + y * y + z * z
        if nearest * nearest < squared < farthest * farthest:  # never true of NaN
            rows[n] = i
            n += 1
    return rows[:n]


def surfels_of(points: Points, times: npt.NDArray[np.float32] | None) -> Surfels:
    """Return the surfels of a sweep's usable points that are seen well enough."""
    surfels = make_surfels(points, times)
    return surfels[surfels.count >= MIN_SURFEL_POINTS]
