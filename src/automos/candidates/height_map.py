"""A height map of the ground around the sensor: its gaps filled, and what it is under a point.

Where no ground was seen, the height is that of ever coarser averages around (pull-push): it is known everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.kernels import kernel


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


def fill_gaps(values: npt.NDArray, weights: npt.NDArray) -> npt.NDArray[np.float32]:
    """Return `values` (H, W), blended where their weight is below 1 with ever coarser averages (pull-push)."""
    h, w = values.shape
    if max(h, w) == 1:
        return values
    coarse = np.empty(((h + 1) // 2, (w + 1) // 2), np.float32)
    coarse_weights = np.empty_like(coarse)
    _halve(values, weights, coarse, coarse_weights)
    filled = np.empty_like(values)
    _double(fill_gaps(coarse, coarse_weights), filled)
    _blend(values, weights, filled)
    return filled


@kernel
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


@kernel
def _double(coarse, fine):  # type: ignore[no-untyped-def]
    for v in range(fine.shape[0]):
        for u in range(fine.shape[1]):
            fine[v, u] = sample(coarse, 0.5 * u - 0.25, 0.5 * v - 0.25)


@kernel
def _blend(values, weights, filled):  # type: ignore[no-untyped-def]
    for v in range(values.shape[0]):
        for u in range(values.shape[1]):
            filled[v, u] += weights[v, u] * (values[v, u] - filled[v, u])


@kernel
def sample(grid, x, y):  # type: ignore[no-untyped-def]
    """Bilinear value of `grid` at column x, row y (whole numbers are the cells' centres), clamped to its border."""
    h, w = grid.shape
    x = min(x, w - 1.0) if x > 0.0 else 0.0  # 0 for what is no number
    y = min(y, h - 1.0) if y > 0.0 else 0.0
    u, v = min(int(x), max(w - 2, 0)), min(int(y), max(h - 2, 0))
    fx, fy = x - u, y - v
    u2, v2 = min(u + 1, w - 1), min(v + 1, h - 1)
    return (1 - fy) * ((1 - fx) * grid[v, u] + fx * grid[v, u2]) + fy * ((1 - fx) * grid[v2, u] + fx * grid[v2, u2])


@kernel
def _interpolate(points, x0, y0, per_cell, height, out):  # type: ignore[no-untyped-def]
    for i in range(len(points)):
        out[i] = sample(height, (points[i, 0] - x0) * per_cell - 0.5, (points[i, 1] - y0) * per_cell - 0.5)
