"""A height map whose gaps are filled with increasingly coarse averages of their surroundings (pull-push)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.kernels import kernel

HeightMap = npt.NDArray[np.floating]


def fill_gaps(values: HeightMap, weights: HeightMap) -> HeightMap:
    """Return `values` (H, W), blended with increasingly coarse averages where their weight is below 1."""
    if max(values.shape) == 1:
        return values
    total, weight = _halved(weights * values), _halved(weights)
    coarse = fill_gaps(total / np.maximum(weight, np.float32(1e-9)), np.minimum(weight, np.float32(1.0)))
    filled = np.empty_like(values)
    _double(coarse, filled)
    return filled + weights * (values - filled)


def _halved(values: HeightMap) -> HeightMap:
    """Return the sums of blocks of 2 x 2 cells of `values`; blocks at the border may be smaller."""
    even = np.pad(values, [(0, n % 2) for n in values.shape])
    return even[::2, ::2] + even[::2, 1::2] + even[1::2, ::2] + even[1::2, 1::2]


@kernel
def _double(coarse, fine):  # type: ignore[no-untyped-def]
    for v in range(fine.shape[0]):
        for u in range(fine.shape[1]):
            fine[v, u] = sample(coarse, 0.5 * u - 0.25, 0.5 * v - 0.25)


@kernel
def sample(grid, x, y):  # type: ignore[no-untyped-def]
    """Bilinear value of `grid` at column x, row y (integers are the cells' centres), clamped to its border."""
    h, w = grid.shape
    x = min(x, w - 1.0) if x > 0.0 else 0.0  # 0 for NaN
    y = min(y, h - 1.0) if y > 0.0 else 0.0
    u, v = min(int(x), max(w - 2, 0)), min(int(y), max(h - 2, 0))
    fx, fy = x - u, y - v
    u2, v2 = min(u + 1, w - 1), min(v + 1, h - 1)
    return (1 - fy) * ((1 - fx) * grid[v, u] + fx * grid[v, u2]) + fy * ((1 - fx) * grid[v2, u] + fx * grid[v2, u2])
