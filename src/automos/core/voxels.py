"""Voxel keys, and hash tables of them."""

import numpy as np

from automos.core.cells import whole_below
from automos.core.kernels import kernel

BITS = 20
"""Bits of a voxel key per axis: 100 km in each direction at 0.2 m. The lowest three bits are free for callers."""


@kernel
def voxel_key(x, y, z, inverse_voxel):  # type: ignore[no-untyped-def]
    """Return the non-negative int64 key of the voxel of a point; its lowest three bits are 0."""
    half = 1 << (BITS - 1)
    kx, ky = whole_below(x * inverse_voxel) + half, whole_below(y * inverse_voxel) + half
    return (((kx << BITS) | ky) << BITS | (whole_below(z * inverse_voxel) + half)) << 3


@kernel
def find_slot(keys, key):  # type: ignore[no-untyped-def]
    """Return the slot of `key` in the open table `keys` (a power of two long, -1 if empty), or an empty slot for it."""
    mask = len(keys) - 1
    slot = (key * np.int64(-7046029254386353131) >> 38) & mask  # 2^64 / golden ratio: neighbouring voxels scatter
    while keys[slot] != -1 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot
