"""Regions of points that touch, as voxels that do."""

import numpy as np
import numpy.typing as npt

from automos.baselines.brick_grid import BrickGrid
from automos.core.scan import Mask


def grow_regions(points: npt.NDArray, is_seed: Mask, is_object: Mask, voxel: float, steps: int) -> Mask:
    """Return (M,) bool: the seeds, and what is reached from them over objects in `steps` steps to touching voxels.

    points : (M, 3) metres.   is_seed, is_object : (M,).   voxel : metres.
    """
    rows = np.flatnonzero(is_seed | is_object)
    if not is_seed.any():
        return is_seed
    grid, ids = _voxels(points[rows], voxel)
    indices = grid.indices()
    is_reached = np.zeros(len(grid), bool)
    border = np.unique(ids[is_seed[rows]])
    is_reached[border] = True
    for _ in range(steps):
        around = np.unique(grid.neighbours(border, indices, 1))
        border = around[(around >= 0) & ~np.append(is_reached, True)[around]]
        is_reached[border] = True
    out = is_seed.copy()
    out[rows] |= is_reached[ids]
    return out


def label_regions(points: npt.NDArray, voxel: float, reach: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return (M,) int32 the region of each point and (M,) int32 its voxel; voxels are joined over `reach` steps.

    points : (M, 3) metres.   voxel : metres.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    grid, ids = _voxels(points, voxel)
    around = grid.neighbours(np.arange(len(grid), dtype=np.int32), grid.indices(), reach)
    voxel_of, other = np.repeat(np.arange(len(grid)), around.shape[1]), around.ravel()
    touches = other >= 0
    links = coo_matrix((touches[touches], (voxel_of[touches], other[touches])), shape=(len(grid), len(grid)))
    _, region = connected_components(links, directed=False)
    return region[ids], ids


def _voxels(points: npt.NDArray, voxel: float) -> tuple[BrickGrid, npt.NDArray[np.int32]]:
    grid = BrickGrid(voxel, np.stack([points.min(axis=0), points.max(axis=0)]), 0.0)
    return grid, grid.add(points)
