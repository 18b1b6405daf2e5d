"""ERASOR: a bin that reaches much higher in the map than in a scan contained an object that left.

Our reading of Lim, Hwang and Myung, "ERASOR: Egocentric Ratio of Pseudo Occupancy-Based Dynamic Object Removal for
Static 3D Point Cloud Map Building" (RA-L 2021), paper III-B of Chen et al. The scans of one submap are aggregated into
voxels. Around each scan, map and scan are divided into polar bins. Where the ratio of their height spans ("pseudo
occupancy") is small, the bin's voxels above a plane fitted to its lowest part (R-GPF) are removed from the map. A point
is a candidate if its voxel was removed. The map is edited in place: later scans are compared with a cleaner map.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse, transform
from automos.core.kernels import kernel
from automos.core.scan import Frames
from automos.core.voxels import VoxelMap
from automos.evidence.paper.erasor_bins import Rules, Volume, compare_bins
from automos.evidence.paper.submaps import cut_submaps
from automos.settings import ErasorSettings


class Published(NamedTuple):
    """Constants, as in the authors' large_scale.yaml, their preset for whole sequences.

    Attributes
    ----------
    rings, sectors : int, numbers of bins of the volume of interest.
    min_points : int, least number of scan voxels in a bin that is compared.
    bin_max_height : float, metres, version 2: a removed bin must reach higher than this.
    min_removed_span : float, metres, version 3: a removed bin must span more than this.
    plane : tuple, arguments of R-GPF, see `fit_region_ground`.
    ego_radius : float, metres; nearer points are the ego body.
    submap_scans, submap_length : int, float, scans, metres driven; ours: they bound memory; a car is visible for less.
    """

    rings: int = 20
    sectors: int = 108
    min_points: int = 6
    bin_max_height: float = 0.2
    min_removed_span: float = 0.5
    plane: tuple[float, int, int, int, float] = (0.5, 5, 20, 3, 0.25)
    ego_radius: float = 2.7
    submap_scans: int = 200
    submap_length: float = 160.0


PUBLISHED = Published()


def find_candidates(
    frames: Frames, settings: ErasorSettings, start: int = 0, published: Published = PUBLISHED
) -> Iterator[tuple[int, npt.NDArray[np.float32]]]:
    """Yield (index, score) of every frame from `start` on, in order.

    Parameters
    ----------
    frames : Frames, of a recording.
    start : int, index of the first frame to return.

    Yields
    ------
    index and (M,) float32 score of each of the frame's points: 1 where ERASOR removed its voxel, else 0.
    """
    origins = frames.T_level_sensor[:, :3, 3]
    for first, last, own_first, own_last in cut_submaps(origins, published.submap_scans, published.submap_length):
        if own_last > start:
            own = range(max(own_first, start), own_last)
            yield from zip(own, clean_submap(frames, range(first, last), own, settings, published), strict=True)


def clean_submap(
    frames: Frames, submap: range, own: range, settings: ErasorSettings, published: Published = PUBLISHED
) -> Iterator[npt.NDArray[np.float32]]:
    """Yield for each frame in `own` the (M,) float32 score of its points: 1 where their voxel was removed.

    submap : range, the frames that make the map and are compared with it.
    """
    # z up at the sensor's mount, ground under the vehicle at z = 0, so heights are above that ground.
    T_body_sensor = frames.T_level_sensor[0].copy()
    T_body_sensor[:2, 3] = 0.0
    voxels = VoxelMap(settings.voxel, frames.T_level_sensor[submap[0], :3, 3])
    ids_of = []
    for k in submap:
        frame = frames[k]
        ids = np.full(len(frame.points), -1, np.int32)
        is_outside = np.einsum("ij,ij->i", frame.points[:, :2], frame.points[:, :2]) > published.ego_radius**2
        ids[is_outside] = voxels.add(frame.points_level[is_outside])
        ids_of.append(ids)

    mean = voxels.mean
    is_alive = np.ones(len(mean), bool)
    was_scanned = np.full(len(mean), -1, np.int32)
    rejected: dict[int, npt.NDArray[np.bool_]] = {}
    for k in submap[:: settings.every]:
        frame, ids = frames[k], ids_of[k - submap[0]]
        near = _voxels_near(mean, frame.origin_level.astype(np.float32), np.float32(settings.max_range))
        rejected[k] = compare_bins(
            near,
            transform(T_body_sensor @ inverse(frame.T_level_sensor), mean[near]),
            is_alive,
            was_scanned,
            np.int32(k),
            transform(T_body_sensor, frame.points),
            ids,
            *_for_kernel(settings, published),
        )
    for k in own:
        ids = ids_of[k - submap[0]]
        is_candidate = (ids >= 0) & ~np.append(is_alive, True)[ids]  # id -1 reads the True at the end
        if k in rejected:
            is_candidate |= rejected[k]
        yield is_candidate.astype(np.float32)


def _for_kernel(settings: ErasorSettings, published: Published) -> tuple[Volume, Rules]:
    return (
        Volume(settings.max_range, published.rings, published.sectors, settings.min_height, settings.max_height),
        Rules(settings.version, settings.scan_ratio, *published[2:6]),
    )


@kernel
def _voxels_near(mean, origin, max_range):  # type: ignore[no-untyped-def]
    near = np.empty(len(mean), np.int64)
    n = 0
    for v in range(len(mean)):
        dx, dy = mean[v, 0] - origin[0], mean[v, 1] - origin[1]
        if dx * dx + dy * dy <= max_range * max_range:
            near[n] = v
            n += 1
    return near[:n]
