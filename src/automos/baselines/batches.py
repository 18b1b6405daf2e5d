"""Which scans are seen together: recordings cut into overlapping batches, and the scans that one is compared with.

Batches keep the memory of map-based methods from growing with the drive. A batch answers for its own frames only, but
sees some before and after them: something that stands at the end of the own frames is still seen to leave.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.baselines.brick_grid import BrickGrid, Ids
from automos.core.scan import Frame, Frames, Mask, Pose
from automos.core.voxel_map import VoxelMap


class BatchSize(NamedTuple):
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


def body_of(frames: Frames) -> Pose:
    """Return T_body_sensor: z up at the sensor's mount, the ground under the vehicle at z = 0."""
    T_body_sensor = frames.T_level_sensor[0].copy()
    T_body_sensor[:2, 3] = 0.0
    return T_body_sensor


def is_within(frame: Frame, max_range: float, min_range: float = 0.0) -> Mask:
    """Return (M,) bool: which points of `frame` are between the ranges, metres from the sensor."""
    squared = np.einsum("ij,ij->i", frame.points, frame.points)
    return (squared <= max_range**2) & (squared >= min_range**2)


def add_points(voxels: BrickGrid | VoxelMap, frame: Frame, max_range: float, min_range: float = 0.0) -> Ids:
    """Add the points of `frame` between the ranges, metres; return (M,) int32, the voxel of each, -1 for others."""
    return add_used(voxels, frame, is_within(frame, max_range, min_range))


def add_used(voxels: BrickGrid | VoxelMap, frame: Frame, used: Mask) -> Ids:
    """Add the points of `frame` that are `used` (M,); return (M,) int32, the voxel of each, -1 for others."""
    ids = np.full(len(used), -1, np.int32)
    ids[used] = voxels.add(frame.points_level[used])
    return ids


def labels_of_voxels(ids: Ids, is_moving: Mask) -> Mask:
    """Return (M,) bool: the points whose own voxel is moving. This is how every map here becomes labels of scans.

    ids : (M,) voxel of each point, -1 for none (never moving).   is_moving : (V,) bool.
    """
    return np.append(is_moving, False)[ids]  # id -1 reads the False at the end


def labels_by_map(
    frames: Frames, batch: Batch, ids_of: list[Ids], is_removed: Mask, places: npt.NDArray, within: float
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of the batch's own frames: the points whose voxel is removed from a map.

    Those `within` metres of what the map keeps stay (0: all are moving). This forgives a surface that was cut at a
    voxel's border.

    ids_of : of each frame, the voxel of each point.   is_removed, places : (V,) and (V, 3), level frame, of the voxels.
    """
    from scipy.spatial import cKDTree

    keeps_some = within and not is_removed.all()
    kept = cKDTree(places[~is_removed], balanced_tree=False, compact_nodes=False) if keeps_some else None
    for k in batch.own:
        is_moving = labels_of_voxels(ids_of[k - batch.frames[0]], is_removed)
        if kept is not None and is_moving.any():
            away, _ = kept.query(frames[k].points_level[is_moving], distance_upper_bound=within)
            is_moving[is_moving] = ~np.isfinite(away)
        yield k, is_moving


def scans_at(stamps: npt.NDArray, index: int, offsets: npt.ArrayLike) -> list[int]:
    """Return the scans nearest to `offsets` seconds after scan `index` (before it where negative), itself never.

    Where two offsets have the same nearest scan it is named once; where the recording has none within half an offset,
    none is. The order is that of `offsets`.

    stamps : (N,) seconds, increasing.
    """
    found: list[int] = []
    for offset in np.atleast_1d(np.asarray(offsets, np.float64)):
        away = np.abs(stamps - (stamps[index] + offset))
        j = int(away.argmin())
        if j != index and j not in found and away[j] <= 0.5 * abs(offset):
            found.append(j)
    return found
