"""Pfreundschuh's method: clusters of a scan move as a whole if enough of their points were seen as free.

Pfreundschuh, Hendrikx, Reijgwart, Dube, Siegwart, Cramariuc, "Dynamic Object Aware LiDAR SLAM based on Automatic
Generation of Training Data" (ICRA 2021), as Chen et al. compare with it: visibility by Removert, HDBSCAN over what is
not ground, one vote per cluster.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from automos.baselines import removert
from automos.baselines.batches import is_within
from automos.core.parallel import map_in_order
from automos.core.scan import Frames, Mask
from automos.evidence.ground import find_ground
from automos.objects.paper.voxels import group_by_voxel
from automos.settings import GroundSettings

_Task = tuple[npt.NDArray[np.float32], Mask]


@dataclass(frozen=True)
class Parameters:
    """HDBSCAN and the vote of the paper's section III; Removert's parameters for what was seen as free.

    Attributes
    ----------
    min_cluster_size : int
        Voxels.
    voxel : float
        Metres, points are clustered as voxels of this size (0: as they are).
    max_range : float
        Metres, points used.
    share : float
        Of a cluster's points that must have been seen as free.
    """

    visibility: removert.Parameters = removert.PUBLISHED
    min_cluster_size: int = 10
    voxel: float = 0.15
    max_range: float = 60.0
    share: float = 0.3


def find_moving(
    frames: Frames,
    parameters: Parameters,
    ground: GroundSettings,
    start: int = 0,
    workers: int = 0,
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order."""
    eligible: dict[int, npt.NDArray[np.int64]] = {}

    def tasks() -> Iterator[_Task]:
        for k, is_seen_through in removert.find_moving(frames, parameters.visibility, start):
            frame = frames[k]
            is_object = ~find_ground(frame.points_level, frame.origin_level, ground)[0]
            eligible[k] = np.flatnonzero(is_object & is_within(frame, parameters.max_range))
            yield frame.points_level[eligible[k]], is_seen_through[eligible[k]]

    # Processes: HDBSCAN holds the interpreter's lock.
    for k, voted in enumerate(map_in_order(partial(_vote, parameters), tasks(), workers), start):
        is_moving = np.zeros(len(frames[k].points), bool)
        is_moving[eligible.pop(k)] = voted
        yield k, is_moving


def _vote(parameters: Parameters, task: _Task) -> Mask:
    """Return (K,) bool: the points of clusters of which enough points were seen as free."""
    points, is_seen_through = task
    group, mean = group_by_voxel(points, parameters.voxel)
    cluster = cluster_points(mean, parameters.min_cluster_size)[group]
    inside = cluster >= 0
    n = int(cluster.max(initial=-1)) + 1
    size = np.bincount(cluster[inside], minlength=n)
    through = np.bincount(cluster[inside], is_seen_through[inside], n)
    return inside & np.append(through >= parameters.share * size, False)[cluster]


def cluster_points(points: npt.NDArray, min_cluster_size: int) -> npt.NDArray[np.int64]:
    """Return (N,) HDBSCAN's cluster of each of `points` (N, 3), -1 for none."""
    if len(points) <= min_cluster_size:
        return np.full(len(points), -1, np.int64)
    from hdbscan import HDBSCAN  # takes a second to import

    fit = HDBSCAN(min_cluster_size=min_cluster_size, core_dist_n_jobs=1)
    return fit.fit_predict(np.asarray(points, np.float64))
