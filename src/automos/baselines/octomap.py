"""Octomap-based removal: what rays went through more often than they ended in it was there for a while only.

Our reading of Arora, Wiesmann, Chen, Stachniss, "Mapping the Static Parts of Dynamic Scenes from 3D LiDAR Point Clouds
Exploiting Ground Segmentation" (ECMR 2021): occupancy of voxels by ray casting with OctoMap's sensor model, batch by
batch; voxels with ground points stay occupied, whatever grazing rays say; a point is moving if its voxel is free, and
where its voxel is unknown its nearest neighbours decide.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.baselines.batches import BATCH, Batch, BatchSize, add_points, body_of, cut_batches, labels_by_map
from automos.baselines.brick_grid import BrickGrid, Ids
from automos.baselines.height_images import HEIGHT_IMAGES, HeightImages, find_ground
from automos.core.geometry import transform
from automos.core.kernels import kernel
from automos.core.scan import Frame, Frames, Mask


@dataclass(frozen=True)
class Parameters:
    """OctoMap's own sensor model (Hornung et al., Autonomous Robots 2013), voxels and ground of Arora et al.

    Attributes
    ----------
    voxel : float
        Metres.
    max_range : float
        Metres; longer rays are not cast, their ends are unknown.
    hit, miss : float
        Probability of occupied given a hit, given a ray through.
    lowest, highest : float
        Probabilities that no voxel goes beyond.
    neighbours : int
        Nearest known points that decide on an unknown one.
    kept_within : float
        Metres; what is so near to what the map keeps stays (0: by voxel alone). Ours: see docs/baselines.md.
    """

    batch: BatchSize = BATCH
    voxel: float = 0.1
    max_range: float = 60.0
    hit: float = 0.7
    miss: float = 0.4
    lowest: float = 0.12
    highest: float = 0.97
    ground: HeightImages = HEIGHT_IMAGES
    neighbours: int = 5
    kept_within: float = 0.1


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order: the points whose voxel is free."""
    for batch in cut_batches(frames, parameters.batch, start):
        ids_of, is_free, centres = _map_batch(frames, batch, parameters)
        for k, is_moving in labels_by_map(frames, batch, ids_of, is_free, centres, parameters.kept_within):
            yield k, _ask_neighbours(frames[k], ids_of[k - batch.frames[0]], is_moving, parameters.neighbours)


def _map_batch(frames: Frames, batch: Batch, parameters: Parameters) -> tuple[list[Ids], Mask, npt.NDArray]:
    """Return each frame's points' voxels, -1 for none, (V,) which voxels are free, and their centres (V, 3)."""
    grid = BrickGrid(
        parameters.voxel, frames.T_level_sensor[batch.frames[0] : batch.frames[-1] + 1, :3, 3], parameters.max_range
    )
    T_body_sensor = body_of(frames)  # what the vehicle stands on may rise and fall
    ids_of, ground_ids = [], []
    for k in batch.frames:
        frame = frames[k]
        ids = add_points(grid, frame, parameters.max_range)
        ids_of.append(ids)
        ground_ids.append(ids[find_ground(transform(T_body_sensor, frame.points), parameters.ground) & (ids >= 0)])
    is_pinned = np.zeros(len(grid), bool)
    is_pinned[np.concatenate(ground_ids)] = True

    log_odds = np.zeros(len(grid), np.float32)
    passed, hit = np.full((2, len(grid)), -1, np.int32)
    chances = np.array([parameters.hit, parameters.miss, parameters.lowest, parameters.highest])
    model = np.log(chances / (1.0 - chances)).astype(np.float32)
    for k, ids in zip(batch.frames, ids_of, strict=True):
        frame = frames[k]
        grid.pass_rays(frame.origin_level, _shortened(frame, parameters.max_range), k, passed)
        hit[ids[ids >= 0]] = k
        _update(log_odds, passed, hit, k, *model)
    centres = grid.low + (grid.indices() + 0.5) * parameters.voxel
    return ids_of, (log_odds < 0.0) & ~is_pinned, centres


def _shortened(frame: Frame, max_range: float) -> npt.NDArray[np.float32]:
    """Return the ends (M, 3) of the frame's rays, level frame, none further than `max_range` from the sensor."""
    ranges = np.sqrt(np.einsum("ij,ij->i", frame.points, frame.points))
    points = frame.points * np.minimum(max_range / ranges, 1.0)[:, None]
    return transform(frame.T_level_sensor, points.astype(np.float32))


@kernel
def _update(log_odds, passed, hit, stamp, more, less, lowest, highest):  # type: ignore[no-untyped-def]
    """One scan's say: once per voxel, and a hit outweighs any number of rays through."""
    for v in range(len(log_odds)):
        if hit[v] == stamp:
            log_odds[v] = min(log_odds[v] + more, highest)
        elif passed[v] == stamp:
            log_odds[v] = max(log_odds[v] + less, lowest)


def _ask_neighbours(frame: Frame, ids: Ids, is_moving: Mask, n: int) -> Mask:
    """Return `is_moving`, points without a voxel labelled as most of their `n` nearest neighbours that have one."""
    unknown, known = np.flatnonzero(ids < 0), np.flatnonzero(ids >= 0)
    if len(unknown) and len(known) >= n:
        from scipy.spatial import cKDTree

        _, nearest = cKDTree(frame.points[known]).query(frame.points[unknown], k=[*range(1, n + 1)], workers=-1)
        is_moving[unknown] = is_moving[known[nearest]].mean(axis=1) > 0.5
    return is_moving
