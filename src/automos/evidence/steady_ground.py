"""The ground that a scan sees, mended by what the scans just before it saw: the ground stands still.

One scan cannot tell ground that rises from the lowest row of rays on a car behind a guard rail, and knows nothing of
what its rows pass over. But other rows met the ground there a moment ago. What is higher than they say is no ground,
and where a scan has seen none, theirs is taken. Nothing ever raises the ground: the long side of a tram looks even to
every scan for as long as it passes.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter

from automos.evidence.ground import STEP
from automos.evidence.height_map import MAX_STEP, GroundMap, surface_of

Cells = npt.NDArray[np.int64]
Heights = npt.NDArray[np.float32]
SCANS_BEFORE = 10  # whose ground is known: about a second
ENOUGH = 100  # common cells from which on two maps are levelled with each other: poses without heights are given, too
_EXACT = 1e-3  # metres to which heights are compared
_AROUND = 5  # cells, side of the square whose ground is compared with its middle's


def mended(ground: GroundMap, before: Sequence[GroundMap]) -> GroundMap:
    """Return the `ground` of a scan as it and the scans `before` saw it."""
    if not ground.is_seen.any() or not before:
        return ground
    own = _on_grid(ground.cells, ground.heights, ground.width)
    cells, heights = _middles(*_shifted_onto(ground, own, before))
    if len(cells) == 0:
        return ground
    known = _on_grid(cells, heights, ground.width)
    around = _means_around(known)[ground.cells]
    is_too_high = ground.heights - around > STEP  # False where nothing is known, NaN
    ours = np.where(is_too_high, around, ground.heights)
    is_new = np.isnan(own[cells]) & (heights - surface_of(ground).ravel()[cells] < MAX_STEP)
    return ground._replace(
        cells=np.concatenate([ground.cells, cells[is_new]]), heights=np.concatenate([ours, heights[is_new]])
    )


def _shifted_onto(ground: GroundMap, own: Heights, before: Sequence[GroundMap]) -> tuple[Cells, Heights]:
    """Return cells (K,) of the map `ground` that maps `before` know, and their heights, each map level with `own`."""
    width, found = ground.width, [(np.zeros(0, np.int64), np.zeros(0, np.float32))]
    for other in before:
        row, column = np.divmod(other.cells, width)
        right, down = np.round((other.corner - ground.corner) / ground.cell).astype(np.int64)
        row, column = row + down, column + right
        inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < width)
        cells, heights = (row * width + column)[inside], other.heights[inside]
        off = own[cells] - heights
        off = off[np.isfinite(off)]
        found.append((cells, heights + np.median(off) if len(off) >= ENOUGH else heights))
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))  # type: ignore[return-value]


def _middles(cells: Cells, heights: Heights) -> tuple[Cells, Heights]:
    """Return the distinct `cells` and the median height of each; of an even number, the lower middle one."""
    lowest = heights.min(initial=0.0)
    both = np.sort((cells << 32) + np.round((heights - lowest) / _EXACT).astype(np.int64))  # faster than two keys
    bounds = np.append(np.flatnonzero(np.diff(both >> 32, prepend=-1)), len(both))
    middle = both[(bounds[:-1] + bounds[1:] - 1) // 2]
    return middle >> 32, ((middle & 0xFFFFFFFF) * _EXACT + lowest).astype(np.float32)


def _on_grid(cells: Cells, heights: Heights, width: int) -> Heights:
    """Return (width * width,) the heights of all cells, NaN where unknown."""
    grid = np.full(width * width, np.nan, np.float32)
    grid[cells] = heights
    return grid


def _means_around(grid: Heights) -> Heights:
    """Return (W * W,) the mean of the known values of `grid` (W * W,) around each cell, NaN where there is none."""
    width = round(np.sqrt(len(grid)))
    known = np.isfinite(grid)
    total, share = (
        uniform_filter(values.reshape(width, width).astype(np.float64), _AROUND, mode="constant").ravel()
        for values in (np.where(known, grid, 0.0), known)
    )
    is_any = share > 0.5 / _AROUND**2
    return np.divide(total, share, out=np.full(len(grid), np.nan), where=is_any).astype(np.float32)
