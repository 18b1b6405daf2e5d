"""M-detector's tests of one point against depth images of the past: what hides, or hides behind, what was seen there.

Case 1 is for what crosses the view, 2 for what goes away along a ray, 3 for what comes nearer. In case 1 an image in
which something stood where the point lies says nothing; in cases 2 and 3 the point is not an event then.
"""

from typing import NamedTuple

import numpy as np

from automos.baselines.depth_images import Window, agrees, is_even, pixels_around, seen_from, surface_at, turn_between
from automos.baselines.range_image import pixel_of
from automos.core.cells import moved
from automos.core.kernels import kernel


class Crossing(NamedTuple):
    """Case 1. Metres, rad: how far before an image a point must lie, of how many images, and where it stands.

    It stands, too, within `surface` of the plane through what stood around it (`surface_window`, within
    `surface_reach`); from `surface_from` on that grows by `surface_slope` a metre.
    """

    depth: float
    images: int
    stands: Window
    tolerance: float
    surface: float
    surface_from: float
    surface_slope: float
    surface_window: Window
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


@kernel
def leave_out_standing(points, is_asked, T, past, window, tolerance, images, shape):  # type: ignore[no-untyped-def]
    """Unset `is_asked` (M,) of `points` (M, 3) that lie on what stood in the newest images: most points do.

    T : (I, 3, 4) float32, from the points' frame to each image's.
    """
    for i in range(len(points)):
        for j in range(min(images, len(T))):
            if is_asked[i]:
                a, b, r = seen_from(T[j], points[i, 0], points[i, 1], points[i, 2])
                is_asked[i] = not agrees(past.start[j], past.rays, a, b, r, window, tolerance, shape)


@kernel
def find_crossing(points, is_asked, T, past, case, shape):  # type: ignore[no-untyped-def]
    """Return (M,) bool: what hides all that enough images saw around its direction, and stood in none of these.

    Each image is asked for itself: a walker lies where he stood a scan ago, but hides what was seen there before.
    """
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if not is_asked[i]:
            continue
        n = 0
        for j in range(len(T)):
            if n + len(T) - j < case.images:  # too few are left
                break
            if _hides(points[i], T[j], past.nearest[j], case.depth, shape):
                a, b, r = seen_from(T[j], points[i, 0], points[i, 1], points[i, 2])
                n += not _stood(past.start[j], past.rays, a, b, r, case, shape)
                if n == case.images:
                    out[i] = True
                    break
    return out


@kernel
def _stood(start, rays, azimuth, elevation, r, case, shape):  # type: ignore[no-untyped-def]
    """Return whether in an image something stood where a point lies, or a surface ran on through there."""
    if agrees(start, rays, azimuth, elevation, r, case.stands, case.tolerance, shape):
        return True
    surface = surface_at(start, rays, azimuth, elevation, r, case.surface_window, case.surface_reach, shape)
    return abs(surface - r) < case.surface + case.surface_slope * max(r - case.surface_from, 0.0)


@kernel
def _hides(point, T, nearest, depth, shape):  # type: ignore[no-untyped-def]
    """Return whether `point` lies before all that an image saw around its direction."""
    x, y, z = moved(T, point[0], point[1], point[2])
    v, u, r = pixel_of(x, y, z, shape)
    return v >= 0 and nearest[v, u] < np.inf and r < nearest[v, u] - depth


@kernel
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


@kernel
def _has_predecessor(azimuth, elevation, r, T_between, gaps, past, case, shape):  # type: ignore[no-untyped-def]
    """Return whether the newest image has a point that this one left, and the one before it has one for that point."""
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


@kernel
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


@kernel(error_model="numpy")  # two scans may be of one time
def _speed(ray, azimuth, elevation, r, gap, case):  # type: ignore[no-untyped-def]
    """Return how fast, m/s, something went from `ray` (4,) to here along the ray; 0 if it is none of the case."""
    way = case.sign * (r - ray[2])
    if way < case.depth + case.share * r or way > case.reach or way < case.min_speed * gap:
        return 0.0
    if abs(turn_between(ray[0], azimuth)) > case.same.width or abs(ray[1] - elevation) > case.same.height:
        return 0.0
    return way / gap
