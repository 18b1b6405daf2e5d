"""ERASOR: a bin that reaches much higher in the map than in a scan contained an object that left.

Our reading of Lim, Hwang and Myung, "ERASOR: Egocentric Ratio of Pseudo Occupancy-Based Dynamic Object Removal for
Static 3D Point Cloud Map Building" (RA-L 2021), paper III-B of Chen et al. The scans of one submap are aggregated into
voxels. Around each scan, map and scan are divided into polar bins. Where the ratio of their height spans ("pseudo
occupancy") is small, the bin's voxels above a plane fitted to its lowest part (R-GPF) are removed from the map. A point
moves if its voxel was removed. The map is edited in place: later scans are compared with a cleaner map.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from automos.baselines.batches import BATCH, BatchSize, add_used, body_of, cut_batches, labels_of_voxels
from automos.baselines.brick_grid import Ids
from automos.baselines.erasor_bins import Plane, compare_bins
from automos.core.geometry import inverse, transform
from automos.core.scan import Frame, Frames, Mask
from automos.core.voxel_map import VoxelMap


class Parameters(NamedTuple):
    """As in the authors' large_scale.yaml, their preset for whole sequences.

    Attributes
    ----------
    version : int
        2: the paper's rule; 3: the released rule, which removes less.
    voxel : float
        Metres, side of the map's voxels.
    max_range : float
        Metres, radius of the volume of interest.
    rings, sectors : int
        Numbers of its bins.
    min_height, max_height : float
        Metres above the ground under the sensor, between which it lies.
    scan_ratio : float
        Of the height spans of scan and map, below which a bin has changed.
    min_points : int
        Least number of scan voxels in a bin that is compared.
    bin_max_height : float
        Metres, version 2: a removed bin must reach higher than this.
    min_removed_span : float
        Metres, version 3: a removed bin must span more than this.
    plane : tuple
        Arguments of R-GPF, see `fit_region_ground`.
    ego_radius : float
        Metres; nearer points are the ego body.
    every : int
        Scans per comparison with the map.
    batch : BatchSize
        Of a submap.
    """

    version: int = 3
    voxel: float = 0.2
    max_range: float = 80.0
    rings: int = 20
    sectors: int = 108
    min_height: float = -1.3
    max_height: float = 3.0
    scan_ratio: float = 0.2
    min_points: int = 6
    bin_max_height: float = 0.2
    min_removed_span: float = 0.5
    plane: Plane = (0.5, 5, 20, 3, 0.25)
    ego_radius: float = 2.7
    every: int = 4
    batch: BatchSize = BATCH


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool) of every frame from `start` on, in order: the points whose voxel ERASOR removed.

    frames : Frames, of a recording.   start : int, index of the first frame to return.
    """
    for submap, own in cut_batches(frames, parameters.batch, start):
        yield from zip(own, clean_submap(frames, submap, own, parameters), strict=True)


def clean_submap(frames: Frames, submap: range, own: range, parameters: Parameters) -> Iterator[Mask]:
    """Yield for each frame in `own` which of its points (M,) had their voxel removed.

    submap : range, the frames that make the map and are compared with it.
    """
    T_body_sensor = body_of(frames)
    voxels = VoxelMap(parameters.voxel, frames.T_level_sensor[submap[0], :3, 3])
    ids_of = [_add_beside_body(voxels, frames[k], parameters.ego_radius) for k in submap]
    mean = voxels.mean
    is_alive = np.ones(len(mean), bool)
    was_scanned = np.full(len(mean), -1, np.int32)
    rejected: dict[int, Mask] = {}
    for k in submap[:: parameters.every]:
        frame, ids = frames[k], ids_of[k - submap[0]]
        away = mean[:, :2] - frame.origin_level[:2].astype(np.float32)
        near = np.flatnonzero(np.einsum("ij,ij->i", away, away) <= np.float32(parameters.max_range) ** 2)
        of_map = transform(T_body_sensor @ inverse(frame.T_level_sensor), mean[near])
        of_scan = transform(T_body_sensor, frame.points)
        rejected[k] = compare_bins(near, of_map, is_alive, was_scanned, np.int32(k), of_scan, ids, parameters)
    for k in own:
        yield labels_of_voxels(ids_of[k - submap[0]], ~is_alive) | rejected.get(k, False)


def _add_beside_body(voxels: VoxelMap, frame: Frame, ego_radius: float) -> Ids:
    level = frame.points[:, :2]
    return add_used(voxels, frame, np.einsum("ij,ij->i", level, level) > ego_radius**2)
