"""The ground of a scan as heights of cells of the level frame, and the points that lie on it.

Between the cells that were measured, the surface is filled from increasingly coarse averages (pull-push).
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.cells import rough_turn_of
from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import Mask
from automos.settings import GroundSettings

HeightMap = npt.NDArray[np.floating]
SECTORS = 360  # around the sensor
MAX_STEP = 0.3  # metres: greatest difference from the expected height, at any distance; ground is not further below


class GroundMap(NamedTuple):
    """The ground that a scan sees, as the mean heights of cells of the level frame; K of W x W cells are measured."""

    origin: Array  # (3,) metres, of the sensor
    corner: Array  # (2,) metres, of the map, a whole number of cells
    cell: float  # metres, side of a cell
    width: int  # W
    cells: npt.NDArray[np.int64]  # (K,) row * W + column
    heights: npt.NDArray[np.float32]  # (K,) metres, level frame
    is_seen: Mask  # (SECTORS,) around the sensor; none is if no ground is
    lowest: float  # metres, height of the lowest point
    sight: npt.NDArray[np.float16]  # (SECTORS, W / 2) slope of the lowest ray to ground beyond a ring, inf: none


def above_ground(
    ground: GroundMap, points_level: npt.NDArray, settings: GroundSettings
) -> tuple[Mask, npt.NDArray[np.float32]]:
    """Return which of a scan's points (M, 3) are on its `ground`, and the heights of all above it."""
    if not ground.is_seen.any():
        return np.zeros(len(points_level), np.bool_), points_level[:, 2] - np.float32(ground.lowest)
    tolerances = (settings.tolerance, settings.tolerance_per_metre)
    where = (ground.origin, ground.corner, 1.0 / ground.cell, surface_of(ground), ground.is_seen)
    return _measure(points_level, *where, *tolerances)


def surface_of(ground: GroundMap) -> HeightMap:
    """Return (W, W) the heights of all cells, those between measured ones filled in."""
    heights, measured = np.zeros((2, ground.width * ground.width), np.float32)
    heights[ground.cells], measured[ground.cells] = ground.heights, 1.0
    return _fill_gaps(*(grid.reshape(ground.width, ground.width) for grid in (heights, measured)))


def rays_above(ground: GroundMap, places: Array) -> Array:
    """Return (K,) metres, the height of the lowest ray over each of `places` (K, 2) to ground beyond; inf for none."""
    x, y = (places - ground.origin[:2]).T
    turn = np.copysign(0.25 * (1.0 - x / np.maximum(np.abs(x) + np.abs(y), 1e-9)), y) + 0.5  # as `rough_turn_of`
    r = np.maximum(np.hypot(x, y), 1e-9)
    last_sector, last_ring = np.array(ground.sight.shape) - 1
    sector, ring = (turn * SECTORS).astype(np.int64), (r / ground.cell).astype(np.int64)
    return ground.origin[2] + ground.sight[np.minimum(sector, last_sector), np.minimum(ring, last_ring)] * r


def _fill_gaps(values: HeightMap, weights: HeightMap) -> HeightMap:
    """Return `values` (H, W), blended with increasingly coarse averages where their weight is below 1."""
    if max(values.shape) == 1:
        return values
    _blend(_fill_gaps(*_halved(values, weights)), weights, values)
    return values


@kernel
def _halved(values, weights):  # type: ignore[no-untyped-def]
    """Return the weighted means of blocks of 2 x 2 cells, smaller ones at the border, and their weights, 1 at most."""
    h, w = values.shape
    means, sums = np.empty((2, (h + 1) // 2, (w + 1) // 2), np.float32)
    for v in range(means.shape[0]):
        for u in range(means.shape[1]):
            total = weight = np.float32(0.0)
            for b in range(2 * v, min(2 * v + 2, h)):
                for a in range(2 * u, min(2 * u + 2, w)):
                    total += weights[b, a] * values[b, a]
                    weight += weights[b, a]
            means[v, u] = total / max(weight, np.float32(1e-9))
            sums[v, u] = min(weight, np.float32(1.0))
    return means, sums


@kernel
def _blend(coarse, weights, values):  # type: ignore[no-untyped-def]
    """Blend `values` in place with those of the `coarse` grid, where their `weights` are below 1."""
    h, w = values.shape
    left, part = np.empty(w, np.int64), np.empty(w, np.float64)
    for u in range(w):
        left[u], part[u] = _between(0.5 * u - 0.25, coarse.shape[1])
    right = np.minimum(left + 1, coarse.shape[1] - 1)
    for v in range(h):
        above, fy = _between(0.5 * v - 0.25, coarse.shape[0])
        here, below = coarse[above], coarse[min(above + 1, coarse.shape[0] - 1)]
        for u in range(w):
            a, b, fx = left[u], right[u], part[u]
            upper, lower = (1 - fx) * here[a] + fx * here[b], (1 - fx) * below[a] + fx * below[b]
            filled = np.float32((1 - fy) * upper + fy * lower)
            values[v, u] = filled + weights[v, u] * (values[v, u] - filled)


@kernel
def _between(x, n):  # type: ignore[no-untyped-def]
    """Return the first of two neighbours among `n` that `x` lies between, and the second's share; clamped to them."""
    x = min(x, n - 1.0) if x > 0.0 else 0.0  # 0 for NaN
    first = min(int(x), max(n - 2, 0))
    return first, x - first


@kernel
def _sample(grid, x, y):  # type: ignore[no-untyped-def]
    """Bilinear value of `grid` at column x, row y (integers are the cells' centres), clamped to its border."""
    (u, fx), (v, fy) = _between(x, grid.shape[1]), _between(y, grid.shape[0])
    u2, v2 = min(u + 1, grid.shape[1] - 1), min(v + 1, grid.shape[0] - 1)
    return (1 - fy) * ((1 - fx) * grid[v, u] + fx * grid[v, u2]) + fy * ((1 - fx) * grid[v2, u] + fx * grid[v2, u2])


@kernel
def _measure(points, origin, corner, per_cell, surface, is_seen, tolerance, tolerance_per_metre):  # type: ignore[no-untyped-def]
    """Return which points are on the `surface`, and the heights of all above it."""
    h, w = surface.shape
    is_ground, height = np.empty(len(points), np.bool_), np.empty(len(points), np.float32)
    for i in range(len(points)):
        u, v = (points[i, 0] - corner[0]) * per_cell, (points[i, 1] - corner[1]) * per_cell
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        beneath = _sample(surface, u - 0.5, v - 0.5)
        is_low = -MAX_STEP < points[i, 2] - beneath < tolerance + tolerance_per_metre * np.sqrt(x * x + y * y)
        is_ground[i] = is_low and 0.0 <= u < w and 0.0 <= v < h and is_seen[int(rough_turn_of(x, y) * SECTORS)]
        height[i] = points[i, 2] - np.float32(beneath)
    return is_ground, height
