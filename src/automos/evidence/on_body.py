"""Which points of a scan lie on the ego body, or on what is connected to it.

A trailer swings in a bend, and pieces of a bonnet are met by single rays, so the body along each ray is not all of it.
Points that are connected to it belong to it where it is a good part of the whole, and no farther than most scans have
such points in their direction: people who stop beside a car are connected to it, too, but not in most scans.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from automos.core.beam_pattern import BeamPattern, Lidar
from automos.core.range_image import locate
from automos.core.scan import MIN_RANGE, Mask, Points

Ranges = npt.NDArray[np.float32]
ATTACHED_SHARE = 0.3  # least share of a connected part that must lie on the body for the whole part to belong to it
N_SECTORS, SWING = 24, 2
"""Sectors of azimuth, for each of which an extent is learnt, and by how many a trailer may swing to each side."""
_CONNECTED = 0.14  # voxel by which points connect; their ranges enter by logarithms, as returns spread with range


def is_on_body(points: Points, is_ground: Mask, lidar: Lidar) -> Mask:
    """Return (M,) bool: which of `points` (M, 3) of a raw sweep, sensor frame, lie on the body or are connected to it.

    Ground points, `is_ground` (M,) bool, connect nothing.
    """
    if lidar.body is None:
        return np.zeros(len(points), np.bool_)
    return _with_connected(points, is_ground, lidar.body.reach, lidar.pattern, lidar.body.extent)


def extent_in(points: Points, is_ground: Mask, reach: Ranges, pattern: BeamPattern, max_range: float) -> Ranges:
    """Return (N_SECTORS,) the range, metres, of the farthest connected point of a scan; `max_range` is their limit."""
    farthest, anywhere = np.zeros(N_SECTORS, np.float32), np.full(N_SECTORS, max_range, np.float32)
    points = points[_with_connected(points, is_ground, reach, pattern, anywhere)]
    np.maximum.at(farthest, _sector_of(points), np.linalg.norm(points, axis=1))
    return farthest


def extent_in_most(farthest: Sequence[Ranges]) -> Ranges:
    """Return (N_SECTORS,) the range, metres, up to which most scans have connected points, from that of each scan."""
    swept = np.max([np.roll(farthest, k, axis=1) for k in range(-SWING, SWING + 1)], axis=0)
    return np.median(swept, axis=0)


def _with_connected(points: Points, is_ground: Mask, reach: Ranges, pattern: BeamPattern, extent: Ranges) -> Mask:
    """Return (M,) bool: points within `reach` (H, W), and those within `extent` (N_SECTORS,) connected to them."""
    squared = np.einsum("ij,ij->i", points, points)
    near = np.flatnonzero(squared < max(extent.max(), reach.max()) ** 2)
    is_body = np.zeros(len(points), np.bool_)
    is_body[near] = cells_within(points[near], reach, pattern) >= 0
    may_connect = ~is_ground[near] & (squared[near] < extent[_sector_of(points[near])] ** 2)
    near = near[is_body[near] | may_connect]
    if is_body.any():
        part, n_parts = parts_of(points[near])
        total, on_body = np.bincount(part, minlength=n_parts), np.bincount(part, is_body[near], n_parts)
        is_body[near] |= (on_body >= ATTACHED_SHARE * total)[part]
    return is_body


def _sector_of(points: Points) -> npt.NDArray[np.int64]:
    turns = np.arctan2(points[:, 1], points[:, 0]) / np.float32(2.0 * np.pi)
    return np.floor(N_SECTORS * turns).astype(np.int64) % N_SECTORS


def cells_within(
    points: Points, reach: Ranges, pattern: BeamPattern, nearest: Ranges | None = None
) -> npt.NDArray[np.int32]:
    """Return (M,) the cell of each of `points` (M, 3) of a raw sweep nearer than its cell's `reach`, -1 for others.

    Where `nearest` (H, W) is given, points before it have -1, too.
    """
    cell, ranges = locate(points, pattern)
    is_within = ranges < np.append(reach, np.float32(0.0))[cell]
    if nearest is not None:
        is_within &= ranges >= np.append(nearest, np.float32(0.0))[cell]
    return np.where(is_within, cell, np.int32(-1))


def parts_of(points: npt.NDArray) -> tuple[npt.NDArray[np.int32], int]:
    """Return (M,) the connected part that each of `points` (M, 3) belongs to, and one more than the last part."""
    if len(points) == 0:
        return np.zeros(0, np.int32), 0
    ranges = np.maximum(np.linalg.norm(points, axis=1)[:, None], MIN_RANGE)
    voxels = np.floor(points / ranges * np.log(ranges / MIN_RANGE) / _CONNECTED).astype(np.int64)
    voxels -= voxels.min(axis=0)
    grid = np.zeros(voxels.max(axis=0) + 1, np.bool_)
    grid[tuple(voxels.T)] = True
    parts, n_parts = ndimage.label(grid, np.ones((3, 3, 3), bool))
    return parts[tuple(voxels.T)], n_parts + 1
