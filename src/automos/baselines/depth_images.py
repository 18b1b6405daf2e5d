"""Past scans as depth images: all their points in pixels, so that what lies around a direction is found at once."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.baselines.range_image import ImageShape, nearest_ranges, pixel_of
from automos.core.cells import moved, turn_of, whole_below
from automos.core.kernels import kernel
from automos.core.range_image import over_neighbours
from automos.core.scan import Mask, Pose

_FULL_TURN = np.float32(2.0 * np.pi)
_FLAT = 1e-7  # rad^2


class DepthImage(NamedTuple):
    """One scan.

    Attributes
    ----------
    T_level_sensor : (4, 4) float64
        Where it was seen from.
    stamp : float
        Seconds.
    start : (rows * columns + 1,) int32
        Where each pixel's points begin in `rays`.
    rays : (M, 4) float32
        By pixel: azimuth and elevation (rad), range (m), 1 if the point moves and 0 else.
    nearest : (rows, columns) float32
        The shortest range in each pixel and the eight around it, inf if none is.
    """

    T_level_sensor: Pose
    stamp: float
    start: npt.NDArray[np.int32]
    rays: npt.NDArray[np.float32]
    nearest: npt.NDArray[np.float32]


class Stack(NamedTuple):
    """Depth images one behind the other, from new to old: `start` (I, ...) counts through all of their `rays`."""

    start: npt.NDArray[np.int32]
    rays: npt.NDArray[np.float32]
    nearest: npt.NDArray[np.float32]


class Window(NamedTuple):
    """What counts as the same direction: half its width and height, rad, and at least so many metres to each side."""

    width: float
    height: float
    metres: float = 0.0


def draw(points: npt.NDArray, is_moving: Mask, pose: Pose, stamp: float, shape: ImageShape) -> DepthImage:
    """Return the depth image of `points` (M, 3), sensor frame; those outside `shape` are left out."""
    start, rays = _sort_into_pixels(points, is_moving, shape)
    return DepthImage(pose, stamp, start, rays, over_neighbours(nearest_ranges(points, shape), np.minimum))


def stack(images: list[DepthImage]) -> Stack:
    """Return `images` as one."""
    before = np.cumsum([0] + [len(image.rays) for image in images[:-1]])
    start = np.stack([image.start + offset for image, offset in zip(images, before, strict=True)])
    return Stack(
        start.astype(np.int32),
        np.concatenate([image.rays for image in images]),
        np.stack([image.nearest for image in images]),
    )


@kernel
def _sort_into_pixels(points, is_moving, shape):  # type: ignore[no-untyped-def]
    pixel = np.full(len(points), -1, np.int32)
    start = np.zeros(shape.rows * shape.columns + 1, np.int32)
    for i in range(len(points)):
        v, u, _ = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
        if v >= 0:
            pixel[i] = v * shape.columns + u
            start[pixel[i] + 1] += 1
    for p in range(len(start) - 1):
        start[p + 1] += start[p]
    rays, free = np.empty((start[-1], 4), np.float32), start.copy()
    for i in range(len(points)):
        if pixel[i] >= 0:
            k = free[pixel[i]]
            free[pixel[i]] += 1
            rays[k, 0], rays[k, 1], rays[k, 2] = direction_of(points[i, 0], points[i, 1], points[i, 2])
            rays[k, 3] = 1.0 if is_moving[i] else 0.0
    return start, rays


@kernel
def direction_of(x, y, z):  # type: ignore[no-untyped-def]
    """Return azimuth and elevation (rad) and range (m) of a point (float32)."""
    level = np.sqrt(x * x + y * y)
    half = np.float32(0.5)
    return (
        (turn_of(x, y) - half) * _FULL_TURN,
        (turn_of(level, z) - half) * _FULL_TURN,
        np.sqrt(x * x + y * y + z * z),
    )


@kernel
def seen_from(T, x, y, z):  # type: ignore[no-untyped-def]
    """Return the direction (`direction_of`) of a point from where `T` (3, 4) float32 leads to."""
    return direction_of(*moved(T, x, y, z))


@kernel
def pixels_around(azimuth, elevation, width, height, shape):  # type: ignore[no-untyped-def]
    """Return first and last row, first and last column (which may be out of the image: modulo) around a direction."""
    per_column = shape.columns / _FULL_TURN
    first = whole_below((elevation - height - shape.lowest) / shape.row_height)
    last = whole_below((elevation + height - shape.lowest) / shape.row_height)
    left = whole_below((azimuth - width) * per_column + 0.5 * shape.columns)
    right = whole_below((azimuth + width) * per_column + 0.5 * shape.columns)
    return max(first, 0), min(last, shape.rows - 1), left, right


@kernel
def turn_between(a, b):  # type: ignore[no-untyped-def]
    """Return the azimuth `a` minus `b`, rad, in [-pi, pi]."""
    turn = a - b
    if turn > 0.5 * _FULL_TURN:
        return turn - _FULL_TURN
    return turn + _FULL_TURN if turn < -0.5 * _FULL_TURN else turn


@kernel
def agrees(start, rays, azimuth, elevation, r, window, tolerance, shape):  # type: ignore[no-untyped-def]
    """Return whether a point that stands lies in that direction at that range; `start` is one image's."""
    width = max(window.width, window.metres / max(r, 0.3))
    height = max(window.height, window.metres / max(r, 0.3))
    first, last, left, right = pixels_around(azimuth, elevation, width, height, shape)
    for v in range(first, last + 1):
        for u in range(left, right + 1):
            p = v * shape.columns + u % shape.columns
            for k in range(start[p], start[p + 1]):
                if rays[k, 3] > 0.0 or abs(rays[k, 2] - r) >= tolerance:
                    continue
                if abs(turn_between(rays[k, 0], azimuth)) <= width and abs(rays[k, 1] - elevation) <= height:
                    return True
    return False


@kernel
def is_even(start, rays, azimuth, elevation, r, window, tolerance, reach, shape):  # type: ignore[no-untyped-def]
    """Return whether the points around that are within `reach` of range `r` differ from it little, on average."""
    n, sum_ = 0, np.float32(0.0)
    first, last, left, right = pixels_around(azimuth, elevation, window.width, window.height, shape)
    for v in range(first, last + 1):
        for u in range(left, right + 1):
            p = v * shape.columns + u % shape.columns
            for k in range(start[p], start[p + 1]):
                away = abs(rays[k, 2] - r)
                if away >= reach or abs(rays[k, 1] - elevation) > window.height:
                    continue
                if abs(turn_between(rays[k, 0], azimuth)) <= window.width:
                    n += 1
                    sum_ += away
    return sum_ <= tolerance * n


@kernel
def surface_at(start, rays, azimuth, elevation, r, window, reach, shape):  # type: ignore[no-untyped-def]
    """Return the range in a direction of the plane through what stands around it, inf where three points do not.

    Only points within `reach` of range `r` count; `start` is one image's. Least squares over azimuth and elevation.
    """
    n, x_, y_, z_, xx, xy, yy, xz, yz = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    first, last, left, right = pixels_around(azimuth, elevation, window.width, window.height, shape)
    for v in range(first, last + 1):
        for u in range(left, right + 1):
            p = v * shape.columns + u % shape.columns
            for k in range(start[p], start[p + 1]):
                x, y, z = turn_between(rays[k, 0], azimuth), rays[k, 1] - elevation, rays[k, 2] - r
                if rays[k, 3] > 0.0 or abs(z) > reach or abs(x) > window.width or abs(y) > window.height:
                    continue
                n += 1
                x_, y_, z_ = x_ + x, y_ + y, z_ + z
                xx, xy, yy, xz, yz = xx + x * x, xy + x * y, yy + y * y, xz + x * z, yz + y * z
    if n < 3:
        return np.inf
    x_, y_, z_ = x_ / n, y_ / n, z_ / n
    # The small numbers keep the plane from tilting across points that lie on a line.
    xx, xy, yy = xx / n - x_ * x_ + _FLAT, xy / n - x_ * y_, yy / n - y_ * y_ + _FLAT
    xz, yz = xz / n - x_ * z_, yz / n - y_ * z_
    determinant = xx * yy - xy * xy
    return r + z_ - ((xz * yy - yz * xy) * x_ + (yz * xx - xz * xy) * y_) / determinant
