"""Points thinned to one per voxel, and the voxel of each point."""

import numpy as np
import numpy.typing as npt


def group_by_voxel(points: npt.NDArray, voxel: float) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """Return the group (N,) of each of `points` (N, 3), and the mean of every group (G, 3) float32.

    `voxel` is in metres; if 0, every point is its own group.
    """
    if voxel == 0 or not len(points):
        return np.arange(len(points)), np.asarray(points, np.float32)
    cells = np.floor(points / voxel).astype(np.int64)
    cells -= cells.min(axis=0)
    extent = cells.max(axis=0) + 1
    keys = (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2]
    _, group, count = np.unique(keys, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(group, points[:, axis], len(count)) for axis in range(3)], axis=1) / count[:, None]
    return group, mean.astype(np.float32)
