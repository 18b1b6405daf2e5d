"""Recordings cut into overlapping batches, so that the memory of map-based methods does not grow with the drive.

A batch answers for its own frames only, but sees some before and after them: something that stands at the end of the
own frames is still seen to leave.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.baselines.brick_grid import BrickGrid
from automos.core.scan import Frame, Frames, Mask
from automos.core.voxels import VoxelMap


@dataclass(frozen=True)
class BatchSize:
    """How long batches are: they overlap, so what stands at the end of one is seen to leave.

    Neither is published: the authors map whole sequences. Both bound memory, and are longer than a car stays in sight.

    Attributes
    ----------
    scans : int
        At most.
    length : float
        Metres driven, at most.
    """

    scans: int = 200
    length: float = 160.0


BATCH = BatchSize()


class Batch(NamedTuple):
    """Frames seen together, and those among them that are answered for."""

    frames: range
    own: range


def cut_batches(frames: Frames, size: BatchSize, start: int = 0) -> Iterator[Batch]:
    """Yield batches whose own frames tile the recording from `start` on, in order."""
    for batch in tiled(frames.T_level_sensor[:, :3, 3], size):
        if batch.own.stop > start:
            yield Batch(batch.frames, range(max(batch.own.start, start), batch.own.stop))


def tiled(origins: npt.NDArray, size: BatchSize) -> list[Batch]:
    """Return batches whose own scans tile a recording, from where the sensor was in each, `origins` (N, 3), metres.

    A batch extends beyond its own scans on both sides, so that an object at their end is still observed to leave. Both
    scans and metres are bounded: a parked car records thousands of scans in one place, while a motorway drive leaves a
    place within seconds.
    """
    n = len(origins)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(origins, axis=0), axis=1))])[:n]
    batches = []
    own_first = 0
    half_scans, half_length = size.scans // 2, size.length / 2
    while own_first < n:
        own_last = int(np.searchsorted(travelled, travelled[own_first] + half_length, side="right"))
        own_last = min(own_last, own_first + half_scans, n)
        if n - own_last < half_scans // 2 and travelled[-1] - travelled[own_last - 1] < half_length / 2:
            own_last = n  # no short rest at the end
        reach_back = int(np.searchsorted(travelled, travelled[own_first] - half_length / 2))
        reach_on = int(np.searchsorted(travelled, travelled[own_last - 1] + half_length / 2, side="right"))
        first = max(reach_back, own_first - half_scans // 2, 0)
        last = min(reach_on, own_last + half_scans // 2, n)
        batches.append(Batch(range(first, last), range(own_first, own_last)))
        own_first = own_last
    return batches


def is_within(frame: Frame, max_range: float, min_range: float = 0.0) -> Mask:
    """Return (M,) bool: which points of `frame` are between the ranges, metres from the sensor."""
    squared = np.einsum("ij,ij->i", frame.points, frame.points)
    return (squared <= max_range**2) & (squared >= min_range**2)


def add_points(voxels: BrickGrid | VoxelMap, frame: Frame, max_range: float) -> npt.NDArray[np.int32]:
    """Add the points of `frame` up to `max_range`, metres; return (M,) int32, the voxel of each, -1 beyond."""
    used = is_within(frame, max_range)
    ids = np.full(len(used), -1, np.int32)
    ids[used] = voxels.add(frame.points_level[used])
    return ids


def labels_of_voxels(ids: npt.NDArray[np.int32], is_moving: Mask) -> Mask:
    """Return (M,) bool: the points whose own voxel is moving. This is how every map here becomes labels of scans.

    ids : (M,) voxel of each point, -1 for none (never moving).   is_moving : (V,) bool.
    """
    return np.append(is_moving, False)[ids]  # id -1 reads the False at the end


def spare_near_kept(points: npt.NDArray, is_moving: Mask, kept: KeptMap | None) -> Mask:
    """Return (M,) bool: `is_moving` (M,) without those of `points` (M, 3) that lie near what a map keeps.

    The usual way to read labels of scans from a cleaned map. It forgives a surface that was cut at a voxel's border.
    """
    if kept is None or not is_moving.any():
        return is_moving
    away, _ = kept.tree.query(points[is_moving], distance_upper_bound=kept.radius)
    out = is_moving.copy()
    out[is_moving] = ~np.isfinite(away)
    return out


class KeptMap:
    """What a cleaned map keeps, and how near to it (metres) points stay."""

    def __init__(self, points: npt.NDArray, radius: float):
        """Take the map's points (V, 3), level frame."""
        from scipy.spatial import cKDTree

        self.tree, self.radius = cKDTree(points, balanced_tree=False, compact_nodes=False), radius
