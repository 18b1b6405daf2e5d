"""Connected parts of a cloud of points: those in neighbouring voxels, where surfaces fill most of a voxel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from automos.scan import Mask

MAX_HAZY = 0.3
"""Share of the points on surfaces up to which a voxel is in a cloud (as in `candidates.clouds`)."""


def connected_parts(
    points: npt.NDArray, voxel: float, is_solid: Mask | None = None
) -> tuple[npt.NDArray[np.int32], int]:
    """Return (M,) the connected part of each of `points` (M, 3), and one more than the last part.

    voxel : float, metres, edge of a voxel; each is connected with all 26 around it.
    is_solid : (M,) bool, optional, points on surfaces: voxels with few of these, at most `MAX_HAZY`, connect nothing
        (dust between two objects). Their points belong to a part in the next voxel, or to part 0.
    """
    if len(points) == 0:
        return np.zeros(0, np.int32), 1
    voxels = np.floor(points / voxel).astype(np.int64)
    voxels -= voxels.min(axis=0)
    shape = voxels.max(axis=0) + 1
    at = np.ravel_multi_index(tuple(voxels.T), shape)
    count = np.bincount(at, minlength=shape.prod())
    solid = count if is_solid is None else np.bincount(at, is_solid, shape.prod())
    parts, n_parts = ndimage.label((solid > MAX_HAZY * count).reshape(shape), np.ones((3, 3, 3), bool))
    part, beside = parts.reshape(-1)[at], ndimage.maximum_filter(parts, 3).reshape(-1)[at]
    return np.where(part > 0, part, beside), n_parts + 1
