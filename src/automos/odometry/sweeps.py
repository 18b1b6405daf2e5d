"""The points of a scan that a registration can use, moved to mid-sweep."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.odometry.motion import SweepTiming, compensate, sweep_times
from automos.odometry.surfels import Surfels, make_surfels
from automos.scan import Points, Scan
from automos.settings import OdometrySettings, RefineSettings


def usable_points(
    scan: Scan, timing: SweepTiming, twist: npt.NDArray[np.float64], settings: OdometrySettings
) -> tuple[Points, npt.NDArray[np.float32] | None]:
    """Return the valid points in range (M, 3), compensated for `twist` (6,), and their times (M,) or None."""
    squared = np.einsum("ij,ij->i", scan.points, scan.points)
    keep = scan.is_valid & (squared > settings.min_range**2) & (squared < settings.max_range**2)
    points, times = scan.points[keep], sweep_times(scan, timing)
    if times is None:
        return points, None
    return compensate(points, times[keep], twist), times[keep]


def surfels_of(points: Points, times: npt.NDArray[np.float32] | None, settings: RefineSettings) -> Surfels:
    """Return the surfels of a sweep's usable points that are seen well enough."""
    surfels = make_surfels(points, times, settings.surfel, settings.near, settings.max_range)
    return surfels[surfels.count >= settings.min_points]
