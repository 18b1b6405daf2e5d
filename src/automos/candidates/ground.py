"""The ground under one scan, as a height map, and the points that lie on it.

A lower envelope does the work: the ground at a place is no higher than the lowest point of any other place plus the
steepest slope times the distance. On raw heights this envelope must allow steep roads and so would climb up whatever
hides its own foot; it is therefore taken twice, the second time on the heights above a smooth trend through the first,
where a far gentler slope is enough. Both are two raster sweeps (a grey-value distance transform), so the cost is a few
milliseconds whatever the scene. No sensor height, tilt or plane is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from automos.scan import Mask
from automos.settings import GroundSettings

_EMPTY = np.float32(1e9)


@dataclass(frozen=True, eq=False)
class GroundSurface:
    """The height of the ground around the sensor.

    Attributes
    ----------
    corner : (2,) float64, metres, level frame: x, y of the map's lower corner.
    cell : metres, side of a cell.
    height : (H, W) float32, metres, level frame, at the cells' centres (rows along y); filled everywhere.
    """

    corner: npt.NDArray[np.float64]
    cell: float
    height: npt.NDArray[np.float32]

    def height_at(self, points_level: npt.NDArray) -> npt.NDArray[np.float32]:
        """Return (M,) float32 metres: the ground's height under each of `points_level` (M, 2 or more), interpolated."""
        out = np.empty(len(points_level), np.float32)
        _interpolate(points_level, self.corner[0], self.corner[1], 1.0 / self.cell, self.height, out)
        return out


def fit_ground(points_level: npt.NDArray, origin_level: npt.NDArray, settings: GroundSettings) -> GroundSurface:
    """Return the ground around the sensor.

    Parameters
    ----------
    points_level : (M, 3) float32, metres, level frame (z up).
    origin_level : (3,) metres, where the sensor was.
    """
    cell = settings.cell
    n_coarse = 2 * int(np.ceil(settings.max_range / (cell * settings.trend_cells)))
    n = n_coarse * settings.trend_cells
    # A whole number of cells, so that the map does not shift under the world from scan to scan.
    corner = (np.floor(np.asarray(origin_level[:2]) / cell) - n // 2) * cell
    lowest = np.full((n, n), _EMPTY, np.float32)
    origin = np.asarray(origin_level, np.float64)
    grid = (corner[0], corner[1], 1.0 / cell)
    sight = _steepest_sight(points_level, origin, cell, settings.ghost_depth, settings.sectors, n // 2)
    _lowest(points_level, origin, cell, sight, *grid, lowest)
    _drop_ghosts(lowest, settings.lone_ghost_depth)

    envelope = lowest.copy()
    _lower_envelope(envelope, settings.max_slope * cell)
    trend = _trend(lowest, envelope, settings)

    _subtract(lowest, trend, envelope)
    _lower_envelope(envelope, settings.max_slope_from_trend * cell)
    sums, counts = np.zeros((n, n), np.float32), np.zeros((n, n), np.float32)
    _add_seeds(points_level, *grid, trend + envelope, settings.seed_height, sums, counts)
    height, weights = sums / np.maximum(counts, 1.0) - trend, np.minimum(counts, 1.0)
    return GroundSurface(corner, cell, trend + _fill(height, weights))


def segment_ground(points_level: npt.NDArray, origin_level: npt.NDArray, settings: GroundSettings) -> Mask:
    """Return (M,) bool: which of `points_level` (M, 3), level frame, lie on the ground (or beneath it).

    `origin_level` (3,) is where the sensor was. Points beyond `settings.max_range` (square around it) are not ground.
    """
    return is_on_ground(points_level, origin_level, fit_ground(points_level, origin_level, settings), settings)


def is_on_ground(
    points_level: npt.NDArray, origin_level: npt.NDArray, surface: GroundSurface, settings: GroundSettings
) -> Mask:
    """Return (M,) bool: which of `points_level` (M, 3) are at most the tolerance above `surface`."""
    is_ground = np.empty(len(points_level), np.bool_)
    x0, y0 = surface.corner
    _is_low(
        points_level,
        np.asarray(origin_level, np.float64),
        x0,
        y0,
        1.0 / surface.cell,
        surface.height,
        settings.tolerance,
        settings.tolerance_per_metre,
        is_ground,
    )
    return is_ground


def _trend(lowest: npt.NDArray, envelope: npt.NDArray, settings: GroundSettings) -> npt.NDArray[np.float32]:
    """Smooth (H, W) surface through the cells on the first envelope."""
    n = len(lowest) // settings.trend_cells
    sums, counts = np.zeros((n, n), np.float32), np.zeros((n, n), np.float32)
    _add_lowest(lowest, envelope, settings.seed_height, settings.trend_cells, sums, counts)
    coarse = _fill(sums / np.maximum(counts, 1.0), np.minimum(counts, 1.0))
    trend = np.empty_like(lowest)
    _upsample(coarse, settings.trend_cells, trend)
    return trend


def _fill(values: npt.NDArray, weights: npt.NDArray) -> npt.NDArray[np.float32]:
    """Return `values` (H, W), blended where their weight is below 1 with ever coarser averages (pull-push)."""
    h, w = values.shape
    if max(h, w) == 1:
        return values
    coarse = np.empty(((h + 1) // 2, (w + 1) // 2), np.float32)
    coarse_weights = np.empty_like(coarse)
    _halve(values, weights, coarse, coarse_weights)
    filled = np.empty_like(values)
    _upsample(_fill(coarse, coarse_weights), 2, filled)
    _blend(values, weights, filled)
    return filled


@numba.njit(cache=True, nogil=True)
def _halve(values, weights, coarse, coarse_weights):  # type: ignore[no-untyped-def]
    h, w = values.shape
    for v in range(coarse.shape[0]):
        for u in range(coarse.shape[1]):
            total, weight = np.float32(0.0), np.float32(0.0)
            for b in range(2 * v, min(2 * v + 2, h)):
                for a in range(2 * u, min(2 * u + 2, w)):
                    total += weights[b, a] * values[b, a]
                    weight += weights[b, a]
            coarse[v, u] = total / max(weight, np.float32(1e-9))
            coarse_weights[v, u] = min(weight, np.float32(1.0))


@numba.njit(cache=True, nogil=True)
def _blend(values, weights, filled):  # type: ignore[no-untyped-def]
    for v in range(values.shape[0]):
        for u in range(values.shape[1]):
            filled[v, u] += weights[v, u] * (values[v, u] - filled[v, u])


@numba.njit(cache=True, nogil=True)
def _subtract(lowest, trend, above):  # type: ignore[no-untyped-def]
    for v in range(lowest.shape[0]):
        for u in range(lowest.shape[1]):
            above[v, u] = lowest[v, u] - trend[v, u] if lowest[v, u] < 1e8 else 1e9


@numba.njit(cache=True, nogil=True)
def _add_lowest(lowest, envelope, seed_height, block, sums, counts):  # type: ignore[no-untyped-def]
    for v in range(lowest.shape[0]):
        for u in range(lowest.shape[1]):
            if lowest[v, u] < 1e8 and lowest[v, u] - envelope[v, u] < seed_height:
                sums[v // block, u // block] += lowest[v, u]
                counts[v // block, u // block] += 1


@numba.njit(cache=True, nogil=True)
def _turn(x, y):  # type: ignore[no-untyped-def]
    """Direction in the plane as a number in [0, 1) that grows with the angle: cheaper than an arctan."""
    size = abs(x) + abs(y)
    if size == 0.0:
        return 0.0
    turn = 0.25 * (1.0 - x / size)
    return turn if y >= 0.0 else min(1.0 - turn, 0.9999999)


@numba.njit(cache=True, nogil=True)
def _steepest_sight(points, origin, ring, margin, n_sectors, n_rings):  # type: ignore[no-untyped-def]
    """Slope (rise over run) below which a sight line of a sector would pass under ground that was seen nearer by.

    A mirror image under the road is seen through the road; the bound is the second steepest of the nearer cells' lowest
    points, so that a single overhanging thing does not make ghosts of the ground behind it.
    """
    lowest = np.full((n_sectors, n_rings), np.float32(1e9))
    for i in range(len(points)):
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        k = int(np.sqrt(x * x + y * y) / ring)
        if k < n_rings:
            j = int(_turn(x, y) * n_sectors) % n_sectors
            lowest[j, k] = min(lowest[j, k], points[i, 2])
    bound = np.empty((n_sectors, n_rings), np.float32)
    for j in range(n_sectors):
        first, second = -1e9, -1e9
        for k in range(n_rings):
            bound[j, k] = second
            z = lowest[j, k] - origin[2]
            if z < -margin:  # what stands as high as the sensor may hang over the ground
                slope = (z - margin) / (ring * (k + 0.5))
                if slope > first:
                    first, second = slope, first
                elif slope > second:
                    second = slope
    return bound


@numba.njit(cache=True, nogil=True)
def _lowest(points, origin, ring, bound, x0, y0, per_cell, lowest):  # type: ignore[no-untyped-def]
    h, w = lowest.shape
    n_sectors, n_rings = bound.shape
    for i in range(len(points)):
        u, v = int(np.floor((points[i, 0] - x0) * per_cell)), int(np.floor((points[i, 1] - y0) * per_cell))
        if not (0 <= u < w and 0 <= v < h) or points[i, 2] >= lowest[v, u]:
            continue
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        r = np.sqrt(x * x + y * y)
        k = min(int(r / ring), n_rings - 1)
        j = int(_turn(x, y) * n_sectors) % n_sectors
        if points[i, 2] - origin[2] >= r * bound[j, k]:
            lowest[v, u] = points[i, 2]


@numba.njit(cache=True, nogil=True)
def _drop_ghosts(lowest, max_depth):  # type: ignore[no-untyped-def]
    """Empty the cells far below all their neighbours: mirror images and stray returns under the ground."""
    h, w = lowest.shape
    for v in range(h):
        for u in range(w):
            if lowest[v, u] >= 1e8:
                continue
            n_neighbours, has_support = 0, False
            for b in range(max(v - 2, 0), min(v + 3, h)):
                for a in range(max(u - 2, 0), min(u + 3, w)):
                    if (a != u or b != v) and lowest[b, a] < 1e8:
                        n_neighbours += 1
                        has_support |= lowest[b, a] - lowest[v, u] < max_depth
            if n_neighbours >= 3 and not has_support:
                lowest[v, u] = 1e9


@numba.njit(cache=True, nogil=True)
def _lower_envelope(z, rise):  # type: ignore[no-untyped-def]
    """Replace `z` by the highest surface below it that rises by at most `rise` per cell (two chamfer sweeps)."""
    h, w = z.shape
    diagonal = np.float32(rise * 1.4142135)
    straight = np.float32(rise)
    for v in range(h):
        for u in range(w):
            low = z[v, u]
            if u > 0:
                low = min(low, z[v, u - 1] + straight)
            if v > 0:
                low = min(low, z[v - 1, u] + straight)
                if u > 0:
                    low = min(low, z[v - 1, u - 1] + diagonal)
                if u < w - 1:
                    low = min(low, z[v - 1, u + 1] + diagonal)
            z[v, u] = low
    for v in range(h - 1, -1, -1):
        for u in range(w - 1, -1, -1):
            low = z[v, u]
            if u < w - 1:
                low = min(low, z[v, u + 1] + straight)
            if v < h - 1:
                low = min(low, z[v + 1, u] + straight)
                if u < w - 1:
                    low = min(low, z[v + 1, u + 1] + diagonal)
                if u > 0:
                    low = min(low, z[v + 1, u - 1] + diagonal)
            z[v, u] = low


@numba.njit(cache=True, nogil=True)
def _add_seeds(points, x0, y0, per_cell, floor, seed_height, sums, counts):  # type: ignore[no-untyped-def]
    h, w = floor.shape
    for i in range(len(points)):
        u, v = int(np.floor((points[i, 0] - x0) * per_cell)), int(np.floor((points[i, 1] - y0) * per_cell))
        if 0 <= u < w and 0 <= v < h and abs(points[i, 2] - floor[v, u]) < seed_height:
            sums[v, u] += points[i, 2]
            counts[v, u] += 1


@numba.njit(cache=True, nogil=True)
def _sample(grid, x, y):  # type: ignore[no-untyped-def]
    """Bilinear value of `grid` at column x, row y (whole numbers are the cells' centres), clamped to its border."""
    h, w = grid.shape
    x, y = min(max(x, 0.0), w - 1.0), min(max(y, 0.0), h - 1.0)
    u, v = min(int(x), max(w - 2, 0)), min(int(y), max(h - 2, 0))
    fx, fy = x - u, y - v
    u2, v2 = min(u + 1, w - 1), min(v + 1, h - 1)
    return (1 - fy) * ((1 - fx) * grid[v, u] + fx * grid[v, u2]) + fy * ((1 - fx) * grid[v2, u] + fx * grid[v2, u2])


@numba.njit(cache=True, nogil=True)
def _upsample(coarse, factor, fine):  # type: ignore[no-untyped-def]
    for v in range(fine.shape[0]):
        for u in range(fine.shape[1]):
            fine[v, u] = _sample(coarse, (u + 0.5) / factor - 0.5, (v + 0.5) / factor - 0.5)


@numba.njit(cache=True, nogil=True)
def _interpolate(points, x0, y0, per_cell, height, out):  # type: ignore[no-untyped-def]
    for i in range(len(points)):
        out[i] = _sample(height, (points[i, 0] - x0) * per_cell - 0.5, (points[i, 1] - y0) * per_cell - 0.5)


@numba.njit(cache=True, nogil=True)
def _is_low(points, origin, x0, y0, per_cell, height, tolerance, tolerance_per_metre, out):  # type: ignore[no-untyped-def]
    h, w = height.shape
    for i in range(len(points)):
        u, v = (points[i, 0] - x0) * per_cell, (points[i, 1] - y0) * per_cell
        if not (0.0 <= u < w and 0.0 <= v < h):
            out[i] = False
            continue
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        above = points[i, 2] - _sample(height, u - 0.5, v - 0.5)
        out[i] = above < tolerance + tolerance_per_metre * np.sqrt(x * x + y * y)
