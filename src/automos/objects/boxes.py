"""Upright boxes around segments: centre, heading, length, width, height, score (paper III-C).

The heading is the angle at which the visible points lie closest to two sides of their rectangle (the closeness
criterion of Zhang, Xu, Dong and Dolan, "Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners",
IV 2017): a LiDAR sees one or two faces of an object, and the principal axes of an L are not along its sides.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.upright_boxes import Boxes

_MAX_POINTS = 400  # large segments are subsampled evenly, which does not change the heading
_MIN_DISTANCE = 0.05  # m: lower bound of the distance to a side, so that closeness is bounded


def fit_boxes(points: npt.NDArray, ids: npt.NDArray[np.int32], scores: npt.NDArray) -> Boxes:
    """Return the boxes of segments 0..S-1, with `scores` (S,) in [0, 1]; the length is the longer ground side.

    points : (N, 3) metres, a frame with z up.   ids : (N,) segment of each point, -1 for none; all 0..S-1 occur.
    """
    count = len(scores)
    if count == 0:
        return Boxes.empty()
    order, start = _by_segment(ids, count)
    center, size, yaw = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    _fit(np.take(points, order, axis=0).astype(np.float64), start, center, size, yaw)
    return Boxes(center, size, yaw, np.asarray(scores, np.float64))


@kernel
def _by_segment(ids, count):  # type: ignore[no-untyped-def]
    """Return the indices of points sorted by segment (stable), and the start of each segment among them."""
    start = np.zeros(count + 1, np.int64)
    for i in range(len(ids)):
        if ids[i] >= 0:
            start[ids[i] + 1] += 1
    for s in range(count):
        start[s + 1] += start[s]
    order, filled = np.empty(start[count], np.int64), start.copy()
    for i in range(len(ids)):
        if ids[i] >= 0:
            order[filled[ids[i]]] = i
            filled[ids[i]] += 1
    return order, start


@kernel
def _fit(points, start, center, size, yaw):  # type: ignore[no-untyped-def]
    for s in range(len(start) - 1):
        member = points[start[s] : start[s + 1]]
        step = 1 + (len(member) - 1) // _MAX_POINTS
        angle = _best_angle(member[::step])
        c, d = np.cos(angle), np.sin(angle)
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(len(member)):
            u = c * member[i, 0] + d * member[i, 1]
            v = c * member[i, 1] - d * member[i, 0]
            low[0], high[0] = min(low[0], u), max(high[0], u)
            low[1], high[1] = min(low[1], v), max(high[1], v)
            low[2], high[2] = min(low[2], member[i, 2]), max(high[2], member[i, 2])
        x, y, z = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
        center[s, 0], center[s, 1], center[s, 2] = c * x - d * y, d * x + c * y, z
        for k in range(3):  # assigning whole arrays takes two seconds to compile
            size[s, k] = high[k] - low[k]
        yaw[s] = angle
        if size[s, 1] > size[s, 0]:
            size[s, 0], size[s, 1] = size[s, 1], size[s, 0]
            yaw[s] += 0.5 * np.pi
        if yaw[s] > 0.5 * np.pi:
            yaw[s] -= np.pi


@kernel
def _best_angle(points):  # type: ignore[no-untyped-def]
    """Return the angle in [0, pi/2) of greatest closeness, in steps of 3 degrees, then of 0.5 around the best."""
    best_angle, best = 0.0, -1.0
    for low, high, step in ((0.0, 90.0, 3.0), (-3.0, 3.0, 0.5)):
        around = best_angle
        for degrees in np.arange(low, high, step):
            angle = around + np.deg2rad(degrees)
            value = _closeness(points, angle)
            if value > best:
                best_angle, best = angle, value
    return best_angle % (0.5 * np.pi)


@kernel(fastmath=True)
def _closeness(points, angle):  # type: ignore[no-untyped-def]
    c, d = np.cos(angle), np.sin(angle)
    low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(points)):
        u = c * points[i, 0] + d * points[i, 1]
        v = c * points[i, 1] - d * points[i, 0]
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    total = 0.0
    for i in range(len(points)):
        u = c * points[i, 0] + d * points[i, 1]
        v = c * points[i, 1] - d * points[i, 0]
        nearest = min(min(u - low_u, high_u - u), min(v - low_v, high_v - v))
        total += 1.0 / max(nearest, _MIN_DISTANCE)
    return total
