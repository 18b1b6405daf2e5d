"""The ground that a scan sees, mended by what the scans just before it saw: the ground stands still.

One scan cannot tell ground that rises from the lowest row of rays on a car behind a guard rail, and knows nothing of
what its rows pass over. But other rows met the ground there a moment ago, or went through to ground behind. What is
higher than the ground that they met around it is none, nor what stands out and would have stopped their rays. Where a
scan has seen none, theirs is taken, unless it is a step above the scan's own: the long side of a tram looks even for as
long as it passes, and who creeps leaves his shoes to the scans after.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.scan import Mask
from automos.evidence.ground import STEP
from automos.evidence.height_map import GroundMap, rays_above, surface_of

Cells = npt.NDArray[np.int64]
Heights = npt.NDArray[np.float32]
SCANS_BEFORE = 10  # whose ground is known: about a second
ENOUGH = 100  # common cells from which on two maps are levelled with each other: poses without heights are given, too
TOUCHING, SEVERAL = 0.05, 2
"""Metres below a ray up to which ground would have stopped it, and scans of which rays must pass to say so."""
BLOCK = 32  # cells, side of the squares over whose lowest cell what stands out does
_EXACT = 1e-3  # metres to which heights are compared
_AROUND = 5  # cells, side of the square whose ground is compared with its middle's


def mended(ground: GroundMap, before: Sequence[GroundMap]) -> GroundMap:
    """Return the `ground` of a scan as it and the scans `before` saw it."""
    if not ground.is_seen.any():
        return ground
    cells, heights = _middles(*_shifted_onto(ground, before))
    n = len(cells)
    if n == 0:
        return ground
    stops = _stops_rays(ground, np.append(cells, ground.cells), np.append(heights, ground.heights), before)
    if stops[:n].all():
        return ground
    if stops.any():
        likely = surface_of(ground._replace(cells=cells[~stops[:n]], heights=heights[~stops[:n]])).ravel()
        stops[:n] &= heights - likely[cells] > STEP
        stops[n:] &= ground.heights - likely[ground.cells] > STEP
    cells, heights = cells[~stops[:n]], heights[~stops[:n]]
    known = np.full(ground.width**2, np.nan, np.float32)
    known[cells] = heights
    around = _means_around(known.reshape(ground.width, ground.width), ground.cells)
    is_ground = ~stops[n:] & ~(ground.heights - around > STEP)  # NaN where nothing is known around
    ground = ground._replace(cells=ground.cells[is_ground], heights=ground.heights[is_ground])
    known[ground.cells] = np.nan
    is_new = np.isfinite(known[cells]) & (heights - surface_of(ground).ravel()[cells] < STEP)
    return ground._replace(
        cells=np.append(ground.cells, cells[is_new]), heights=np.append(ground.heights, heights[is_new])
    )


def _stops_rays(ground: GroundMap, cells: Cells, heights: Heights, before: Sequence[GroundMap]) -> Mask:
    """Return (K,) which `cells` stand out at `heights` and would have stopped rays of several scans `before`."""
    row, column = np.divmod(cells, ground.width)
    block = (row // BLOCK) * ground.width + column // BLOCK
    lowest = np.full(ground.width**2, np.inf, np.float32)
    np.minimum.at(lowest, block, heights)
    out = heights - lowest[block] > STEP
    places = ground.corner + ground.cell * (np.stack([column, row], axis=-1)[out] + 0.5)
    every_other = list(before)[::2]  # their rays say as much in half the time
    stopped = [rays_above(other, places) < heights[out] + TOUCHING for other in every_other]
    out[out] = np.sum(stopped, axis=0) >= SEVERAL
    return out


def _shifted_onto(ground: GroundMap, before: Sequence[GroundMap]) -> tuple[Cells, Heights]:
    """Return cells (K,) of the map `ground` that maps `before` know, and their heights, each map level with it."""
    width, own = ground.width, np.full(ground.width**2, np.nan, np.float32)
    own[ground.cells] = ground.heights
    found = [(np.zeros(0, np.int64), np.zeros(0, np.float32))]
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


@kernel
def _means_around(grid, cells):  # type: ignore[no-untyped-def]
    """Return (K,) the mean of what is known of `grid` (W, W) around each of `cells`, NaN where that is nothing."""
    w, half, out = len(grid), _AROUND // 2, np.empty(len(cells), np.float32)
    for k in range(len(cells)):
        row, column, total, n = cells[k] // w, cells[k] % w, 0.0, 0
        for v in range(max(row - half, 0), min(row + half + 1, w)):
            for u in range(max(column - half, 0), min(column + half + 1, w)):
                if not np.isnan(grid[v, u]):
                    total += grid[v, u]
                    n += 1
        out[k] = total / n if n else np.nan
    return out
