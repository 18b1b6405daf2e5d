"""One sweep: its raw points, before motion compensation, and the time at which each direction was last observed.

If every scan begins at the same azimuth, a direction has the same time in all of them. A driver that cuts its stream
by time begins each scan at another azimuth, and a scan of more than a turn observes a sector twice.
"""

import numpy as np
import numpy.typing as npt

from automos.core.cells import rough_turn_of
from automos.core.geometry import se3_exp
from automos.core.kernels import kernel
from automos.core.scan import Frame, Mask, Points

MIN_POINTS = 100  # least number of points of a scan that anything is learnt from
N_DIRECTIONS = 360  # azimuth directions for which the time in the sweep is known
_STEPS = 64  # parts of a sweep, each with its own pose: sweeps turn by a few degrees, an error under 1 cm at 50 m
_FIXED = 0.1  # share of a sweep: with a greater standard deviation of its times, a direction has no fixed time


def raw_points(frame: Frame) -> Points:
    """Return (M, 3) float32: the frame's points in the frame of the moving sensor, with motion compensation undone."""
    if frame.sweep_time is None or frame.sweep_motion is None:
        return frame.points
    steps = (np.arange(_STEPS) + 0.5) / _STEPS - 0.5
    T_raw_frame = se3_exp(-steps[:, None] * frame.sweep_motion).astype(np.float32)
    return _transform_by_step(frame.points, frame.sweep_time, T_raw_frame)


def motion_of(frame: Frame) -> npt.NDArray[np.float32]:
    """Return (6,) the twist of the sensor over the sweep; zeros if that or the points' times are unknown."""
    is_known = frame.sweep_motion is not None and frame.sweep_time is not None
    return np.asarray(frame.sweep_motion if is_known else np.zeros(6), np.float32)


def last_looks(raw: Points, times: npt.NDArray[np.float32] | None) -> tuple[npt.NDArray[np.float32], Mask]:
    """Return the time at which a scan last observed each direction, and which of its points are from then.

    A scan of more than a turn observes a sector twice, from two places. One range image can hold only one of them.
    If directions have no fixed time, all times are 0, and all points are from then.

    Parameters
    ----------
    raw : (M, 3) float32, the scan's `raw_points`.   times : (M,) float32 in [-0.5, 0.5], or None.

    Returns
    -------
    sweep_time : (360,) float32, mean time of each direction's last observation.   is_last : (M,) bool.
    """
    unknown = np.zeros(N_DIRECTIONS, np.float32), np.ones(len(raw), np.bool_)
    if times is None or len(raw) < MIN_POINTS:
        return unknown
    is_last, n, total, squares = _last_of_directions(raw, times)
    mean = (total / np.maximum(n, 1)).astype(np.float32)
    spread = np.sqrt(np.maximum(squares / np.maximum(n, 1) - mean.astype(np.float64) ** 2, 0.0))
    if not (n > 1).any() or np.median(spread[n > 1]) > _FIXED:
        return unknown
    seen = np.flatnonzero(n)
    mean = mean[seen[np.searchsorted(0.5 * (seen[1:] + seen[:-1]), np.arange(N_DIRECTIONS))]]
    return mean, is_last if mean.any() else unknown[1]


@kernel
def _last_of_directions(raw, times):  # type: ignore[no-untyped-def]
    """Return which points are of the last turn, and per direction the number, sum and squared sum of their times."""
    direction, latest = np.empty(len(raw), np.int32), np.full(N_DIRECTIONS, np.float32(-1.0))
    for i in range(len(raw)):
        direction[i] = int(rough_turn_of(raw[i, 0], raw[i, 1]) * np.float32(N_DIRECTIONS))
        latest[direction[i]] = max(latest[direction[i]], times[i])
    is_last, n = np.empty(len(raw), np.bool_), np.zeros(N_DIRECTIONS, np.int64)
    total, squares = np.zeros((2, N_DIRECTIONS))
    for i in range(len(raw)):
        k, t = direction[i], np.float64(times[i])
        is_last[i] = times[i] > latest[k] - np.float32(0.5)  # what is older by half a sweep is of an earlier turn
        if is_last[i]:
            n[k] += 1
            total[k] += t
            squares[k] += t * t
    return is_last, n, total, squares


@kernel
def _transform_by_step(points, time, T):  # type: ignore[no-untyped-def]
    out, n = np.empty_like(points), len(T)
    for i in range(len(points)):
        step = (time[i] + 0.5) * n
        M = T[int(min(step, n - 1.0)) if step > 0.0 else 0]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(3):
            out[i, k] = M[k, 0] * x + M[k, 1] * y + M[k, 2] * z + M[k, 3]
    return out
