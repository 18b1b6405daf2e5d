"""The points that odometry uses, and the motion that a sequence of poses describes."""

from itertools import accumulate

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse, se3_log
from automos.core.scan import MIN_RANGE, Points, Pose, Scan
from automos.odometry.compensation import compensate
from automos.odometry.sweep_timing import SweepTiming, sweep_times
from automos.settings import OdometrySettings

MIN_POINTS = 50
"""Usable points that a scan needs for registration, and surfels for the ground in them."""
MIN_STEP = 0.1
"""Metres; over shorter ways there is no direction, and no share of them by which poses disagree."""
ACCELERATION_SECONDS = 0.5
"""Interval over which accelerations are measured: within shorter ones, a handheld sensor shakes more than a vehicle."""
MAX_ACCELERATION = 8.0
"""m/s², an emergency stop. Poses that switch between following the world and the traffic exceed it."""


def usable_points(
    scan: Scan, timing: SweepTiming, twist: Array, settings: OdometrySettings
) -> tuple[Points, npt.NDArray[np.float32] | None]:
    """Return the valid points in range (M, 3), compensated for `twist` (6,), and their times (M,) or None.

    Points with two possible times are left out.
    """
    points, times = timed_points(scan, timing, settings)
    return (points, None) if times is None else (compensate(points, times, twist), times)


def timed_points(
    scan: Scan, timing: SweepTiming, settings: OdometrySettings
) -> tuple[Points, npt.NDArray[np.float32] | None]:
    """Return the valid points in range (M, 3), uncompensated, with times (M,) or None; leaves out ambiguous times."""
    x, y, z = scan.rays.T
    with np.errstate(over="ignore", invalid="ignore"):  # never true of NaN
        squared = (x * x + y * y + z * z).astype(np.float64)
    nearest, farthest = max(settings.min_range, MIN_RANGE), settings.max_range
    rows = np.flatnonzero((nearest * nearest < squared) & (squared < farthest * farthest))
    times = sweep_times(scan, timing)
    if times is not None:
        times = np.take(times, rows)
        is_known = np.isfinite(times)
        if not is_known.all():
            rows, times = rows[is_known], times[is_known]
    return np.take(scan.points, rows, axis=0), times  # [rows] takes five times as long


def chain(T_first: Pose, steps: Pose) -> Pose:
    """Return the (N, 4, 4) poses from `T_first` and the following (N - 1, 4, 4) `steps`."""
    return np.array(list(accumulate(steps, np.matmul, initial=T_first)))


def step_twists(poses: Pose, gaps: Array) -> Array:
    """Return (N, 6) twists per usual gap at each scan: the mean of the steps before and after it."""
    n = len(poses)
    if n < 2:
        return np.zeros((n, 6))
    steps = se3_log(inverse(poses[:-1]) @ poses[1:]) / gaps[:, None]
    before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    return 0.5 * (before + after)


def signed_distance(T_start_end: Pose, forward: Array) -> tuple[Array, Array]:
    """Return the (...,) metres travelled, negative backwards, and the (..., 3) forward direction."""
    travelled = T_start_end[..., :3, 3]
    length = np.linalg.norm(travelled, axis=-1)
    sign = np.where(travelled @ forward < 0.0, -1.0, 1.0)
    direction = sign[..., None] * travelled / np.maximum(length, 1e-9)[..., None]
    return sign * length, np.where((length > 0.5)[..., None], direction, forward)


def greatest_acceleration(poses: Pose, times: Array) -> tuple[float, int]:
    """Return the greatest acceleration, m/s², of (N, 4, 4) `poses` over half a second, and its middle scan."""
    if len(times) < 2:
        return 0.0, 0
    span = max(ACCELERATION_SECONDS, 1.5 * float(np.median(np.diff(times))))
    middle = np.flatnonzero((times - span >= times[0]) & (times + span <= times[-1]))
    if len(middle) == 0:
        return 0.0, 0

    def at(when: Array) -> Array:
        return np.stack([np.interp(when, times, along) for along in poses[:, :3, 3].T], axis=1)

    change = at(times[middle] + span) - 2.0 * poses[middle, :3, 3] + at(times[middle] - span)
    found = np.linalg.norm(change, axis=1) / span**2
    return float(found.max()), int(middle[np.argmax(found)])


def can_be_driven(poses: Pose, times: Array) -> bool:
    """Return whether a vehicle can follow (N, 4, 4) `poses` at `times` (N,), seconds."""
    return greatest_acceleration(poses, times)[0] <= MAX_ACCELERATION
