"""Removert: map points that are nearer than what a scan sees in their direction are removed; some are given back.

Our reading of Kim and Kim, "Remove, then Revert: Static Point Cloud Map Construction using Multiresolution Range
Images" (IROS 2020). Remove: map and scan are projected to range images of the scan, fine pixels first; where the map is
nearer by a share of the range, the map's nearest voxel in that pixel leaves the map. Revert, which the public code
never had: what left is looked at again in ever coarser pixels, in which the nearest return around a direction counts;
what no scan removes there comes back. Grazing ground and edges come back, what left its place does not.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from automos.baselines.batches import BatchSize, add_points, cut_batches, is_within, labels_by_map
from automos.baselines.range_image import NOTHING, ImageShape, image_shape, nearest_ranges, pixel_of
from automos.core.cells import moved
from automos.core.geometry import inverse
from automos.core.kernels import kernel
from automos.core.parallel import available_cores, map_in_order
from automos.core.scan import Frames, Mask, Points
from automos.core.voxel_map import VoxelMap

_BATCH = BatchSize(scans=150)
"""As the authors advise."""


@dataclass(frozen=True)
class Parameters:
    """As the DynamicMap benchmark runs it on KITTI; `revert` is the authors' list, which their code never uses.

    Attributes
    ----------
    voxel : float
        Metres, of the map.
    max_range : float
        Metres, points used.
    remove, revert : tuple of float
        Pixels per degree, one pass each; no `revert`: nothing comes back.
    every : int
        Every how many scans the map is compared with.
    max_elevation_deg : float
        Degrees above and below the sensor that are looked at.
    difference : float
        Of the range, by which the map must be nearer than the scan.
    kept_within : float
        Metres; what is so near to what the map keeps stays (0: by voxel alone). Ours: see docs/baselines.md.
    """

    batch: BatchSize = _BATCH
    voxel: float = 0.05
    max_range: float = 80.0
    remove: tuple[float, ...] = (2.5, 2.2, 2.0)
    revert: tuple[float, ...] = (1.0, 0.9, 0.8, 0.7)
    every: int = 1
    max_elevation_deg: float = 25.0
    difference: float = 0.05
    kept_within: float = 0.1


PUBLISHED = Parameters()


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order: the points whose voxel left the map."""
    for batch in cut_batches(frames, parameters.batch, start):
        voxels = VoxelMap(parameters.voxel, frames.T_level_sensor[batch.frames[0], :3, 3])
        ids_of = [add_points(voxels, frames[k], parameters.max_range) for k in batch.frames]
        mean = voxels.mean
        is_removed = clean_map(mean, frames, batch.frames[:: parameters.every], parameters)
        yield from labels_by_map(frames, batch, ids_of, is_removed, mean, parameters.kept_within)


def clean_map(mean: Points, frames: Frames, scans: range, parameters: Parameters) -> Mask:
    """Return (V,) bool: the voxels of the map `mean` (V, 3), level frame, that `scans` remove and do not give back."""
    is_removed = np.zeros(len(mean), bool)
    for per_degree in parameters.remove:
        static = np.flatnonzero(~is_removed)
        is_removed[static[_condemn(mean[static], frames, scans, per_degree, parameters, only_nearest=True)]] = True
    for per_degree in parameters.revert:
        removed = np.flatnonzero(is_removed)
        is_removed[removed] = _condemn(mean[removed], frames, scans, per_degree, parameters, only_nearest=False)
    return is_removed


def _condemn(
    points: Points, frames: Frames, scans: range, per_degree: float, parameters: Parameters, only_nearest: bool
) -> Mask:
    """Return (V,) bool: the points that any of the scans sees through, of those nearest in their pixel or of all."""
    edge = parameters.max_elevation_deg
    shape = image_shape(1.0 / per_degree, 1.0 / per_degree, -edge, edge)
    condemned = np.zeros(len(points), bool)

    def compare(k: int) -> None:
        # Threads only ever write True here: their order does not matter.
        frame = frames[k]
        seen = nearest_ranges(frame.points[is_within(frame, parameters.max_range)], shape)
        T = inverse(frame.T_level_sensor)[:3].astype(np.float32)
        _mark_seen_through(points, T, seen, shape, parameters.max_range, parameters.difference, only_nearest, condemned)

    for _ in map_in_order(compare, scans, available_cores(), threads=True):
        pass
    return condemned


@kernel
def _mark_seen_through(points, T, seen, shape: ImageShape, max_range, difference, only_nearest, condemned):  # type: ignore[no-untyped-def]
    """Set `condemned` (V,) of `points` (V, 3) that are nearer than `seen`, from the sensor that `T` (3, 4) leads to."""
    nearest = np.full((shape.rows, shape.columns), NOTHING)
    nearest_id = np.full((shape.rows, shape.columns), -1, np.int32)
    for i in range(len(points)):
        x, y, z = moved(T, points[i, 0], points[i, 1], points[i, 2])
        if x * x + y * y > max_range * max_range:
            continue
        v, u, r = pixel_of(x, y, z, shape)
        # of the points that are nearer than what was seen, the nearest is that of the whole pixel
        if v >= 0 and seen[v, u] < NOTHING and seen[v, u] - r > difference * seen[v, u]:
            if not only_nearest:
                condemned[i] = True
            elif r < nearest[v, u]:
                nearest[v, u] = r
                nearest_id[v, u] = i
    for k in nearest_id.flat:
        if k >= 0:
            condemned[k] = True
