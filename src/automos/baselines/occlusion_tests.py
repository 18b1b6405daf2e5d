"""M-detector's tests of one point against depth images of the past: what hides, or hides behind, what was seen there.

Case 1 is for what crosses the view, 2 for what goes away along a ray, 3 for what comes nearer. In all of them a point
that lies where something stood in any of the images is no event.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from automos.baselines.depth_images import (
    Window,
    agrees,
    is_even,
    lies_on_surface,
    pixels_around,
    seen_from,
    turn_between,
)
from automos.baselines.range_image import pixel_of


class Crossing(NamedTuple):
    """Case 1. Metres, rad; `surface_*`: what lies on a triangle of standing points stands.

    The surface's tolerance is `surface_near` up to `surface_from`, beyond it `surface_far` and `surface_per_metre`.
    """

    depth: float
    images: int
    stands: Window
    tolerance: float
    surface: Window
    surface_near: float
    surface_from: float
    surface_far: float
    surface_per_metre: float
    surface_reach: float


class AlongRay(NamedTuple):
    """Cases 2 (`sign` 1, away) and 3 (-1, nearer). Metres, rad, m/s, m/s^2; `even_*`: see `is_even`."""

    sign: float
    same: Window
    depth: float
    share: float
    reach: float
    min_speed: float
    max_acceleration: float
    stands: Window
    tolerance: float
    even: Window
    even_depth: float
    even_reach: float


@numba.njit(cache=True, nogil=True)
def leave_out_standing(points, is_asked, T, past, window, tolerance, images, shape):  # type: ignore[no-untyped-def]
    """Unset `is_asked` (M,) of `points` (M, 3) that lie on what stood in the newest images: most points do.

    T : (I, 3, 4) float32, from the points' frame to each image's.
    """
    for i in range(len(points)):
        for j in range(min(images, len(T))):
            if is_asked[i]:
                a, b, r = seen_from(T[j], points[i, 0], points[i, 1], points[i, 2])
                is_asked[i] = not agrees(past.start[j], past.rays, a, b, r, window, tolerance, shape)


@numba.njit(cache=True, nogil=True)
def find_crossing(points, is_asked, T, past, case, shape):  # type: ignore[no-untyped-def]
    """Return (M,) bool: what hides points of several images, and stands in none."""
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if is_asked[i] and _hides(points[i], T, past, case, shape):
            out[i] = True
            for j in range(len(T)):
                a, b, r = seen_from(T[j], points[i, 0], points[i, 1], points[i, 2])
                start = past.start[j]
                tolerance = case.surface_near
                if r > case.surface_from:
                    tolerance = case.surface_far + case.surface_per_metre * (r - case.surface_from)
                if agrees(start, past.rays, a, b, r, case.stands, case.tolerance, shape) or lies_on_surface(
                    start, past.rays, a, b, r, case.surface, tolerance, case.surface_reach, shape
                ):
                    out[i] = False
                    break
    return out


@numba.njit(cache=True, nogil=True)
def _hides(point, T, past, case, shape):  # type: ignore[no-untyped-def]
    """Tell whether `point` lies before all that enough of the images saw around its direction."""
    n = 0
    for j in range(len(T)):
        x = T[j, 0, 0] * point[0] + T[j, 0, 1] * point[1] + T[j, 0, 2] * point[2] + T[j, 0, 3]
        y = T[j, 1, 0] * point[0] + T[j, 1, 1] * point[1] + T[j, 1, 2] * point[2] + T[j, 1, 3]
        z = T[j, 2, 0] * point[0] + T[j, 2, 1] * point[1] + T[j, 2, 2] * point[2] + T[j, 2, 3]
        v, u, r = pixel_of(x, y, z, shape)
        if v >= 0 and past.nearest[j, v, u] < np.inf and r < past.nearest[j, v, u] - case.depth:
            n += 1
            if n == case.images:
                return True
    return False


@numba.njit(cache=True, nogil=True)
def find_along_ray(points, is_asked, T, T_between, gaps, now, past, case, shape):  # type: ignore[no-untyped-def]
    """Return (M,) bool: what hides behind (before, `case.sign` -1) a point that hid behind (before) another, as fast.

    T_between : (3, 4) float32, from the newest image's frame to the one before's.   gaps : (2,) s between the scans.
    now : Stack of the points' own scan.
    """
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if not is_asked[i]:
            continue
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        a, b, r = seen_from(T[0], x, y, z)
        if not _has_predecessor(a, b, r, T_between, gaps, past, case, shape):
            continue
        stands = False
        for j in range(len(T)):
            aj, bj, rj = seen_from(T[j], x, y, z)
            if agrees(past.start[j], past.rays, aj, bj, rj, case.stands, case.tolerance, shape):
                stands = True
                break
        if not stands:
            a, b, r = seen_from(np.eye(4, dtype=np.float32)[:3], x, y, z)
            out[i] = is_even(now.start[0], now.rays, a, b, r, case.even, case.even_depth, case.even_reach, shape)
    return out


@numba.njit(cache=True, nogil=True)
def _has_predecessor(azimuth, elevation, r, T_between, gaps, past, case, shape):  # type: ignore[no-untyped-def]
    """Tell whether the newest image has a point that this one went away from, and the one before one for that point."""
    start, rays, same = past.start[0], past.rays, case.same
    first, last, left, right = pixels_around(azimuth, elevation, same.width, same.height, shape)
    for v in range(first, last + 1):
        for u in range(left, right + 1):
            p = v * shape.columns + u % shape.columns
            for k in range(start[p], start[p + 1]):
                speed = _speed(rays[k], azimuth, elevation, r, gaps[0], case)
                if speed <= 0.0:
                    continue
                level = rays[k, 2] * np.cos(rays[k, 1])
                x, y = level * np.cos(rays[k, 0]), level * np.sin(rays[k, 0])
                a, b, q = seen_from(T_between, x, y, rays[k, 2] * np.sin(rays[k, 1]))
                if _has_one_as_fast(a, b, q, speed, gaps[1], past, case, shape) and is_even(
                    start, rays, rays[k, 0], rays[k, 1], rays[k, 2], case.even, case.even_depth, case.even_reach, shape
                ):
                    return True
    return False


@numba.njit(cache=True, nogil=True)
def _has_one_as_fast(azimuth, elevation, r, speed, gap, past, case, shape):  # type: ignore[no-untyped-def]
    start, rays, same = past.start[1], past.rays, case.same
    first, last, left, right = pixels_around(azimuth, elevation, same.width, same.height, shape)
    for v in range(first, last + 1):
        for u in range(left, right + 1):
            p = v * shape.columns + u % shape.columns
            for k in range(start[p], start[p + 1]):
                before = _speed(rays[k], azimuth, elevation, r, gap, case)
                if before > 0.0 and abs(before - speed) <= case.max_acceleration * gap:
                    return True
    return False


@numba.njit(cache=True, nogil=True, error_model="numpy")  # two scans may be of one time
def _speed(ray, azimuth, elevation, r, gap, case):  # type: ignore[no-untyped-def]
    """Return how fast, m/s, something went from `ray` (4,) to here along the ray; 0 where it is none of the case."""
    way = case.sign * (r - ray[2])
    if way < case.depth + case.share * r or way > case.reach or way < case.min_speed * gap:
        return 0.0
    if abs(turn_between(ray[0], azimuth)) > case.same.width or abs(ray[1] - elevation) > case.same.height:
        return 0.0
    return way / gap
