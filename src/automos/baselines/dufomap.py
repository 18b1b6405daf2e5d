"""DUFOMap: what was ever inside space that was seen to be empty throughout has moved.

Duberg, Zhang, Jia, Jensfelt, "DUFOMap: Efficient Dynamic Awareness Mapping" (RA-L 2024), by the authors' own library.
A voxel is empty if rays went through all of it and its surroundings, hits inflated by `d_s`, the unknown by `d_p`.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from automos.baselines.batches import BATCH, BatchSize, cut_batches, is_within
from automos.core.extras import import_extra
from automos.core.scan import Frames, Mask


@dataclass(frozen=True)
class Parameters:
    """The authors' example (main.py), for all sensors; names are the library's. The paper's text has `d_p` 1.

    Attributes
    ----------
    resolution : float
        Metres, voxel.
    d_s : float
        Metres that hits are inflated by.
    d_p : int
        Voxels that the unknown is inflated by.
    min_range, max_range : float
        Metres, points used; points at the sensor itself poison its map.
    """

    batch: BatchSize = BATCH
    resolution: float = 0.1
    d_s: float = 0.2
    d_p: int = 2
    min_range: float = 0.2
    max_range: float = 50.0


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order.

    Raises
    ------
    MissingExtraError
        The library is not installed.
    """
    os.environ.setdefault("GLOG_minloglevel", "1")  # else it reports its parameters on the terminal, batch by batch
    dufomap = import_extra("dufomap", "dufomap").dufomap
    for batch in cut_batches(frames, parameters.batch, start):
        space = dufomap(parameters.resolution, parameters.d_s, parameters.d_p)
        for k in batch.frames:
            frame = frames[k]
            used = is_within(frame, parameters.max_range, parameters.min_range)
            space.run(frame.points_level[used], _pose(frame.origin_level), cloud_transform=False)
        space.oncePropagateCluster(if_propagate=True, if_cluster=False)
        for k in batch.own:
            frame = frames[k]
            is_moving = is_within(frame, parameters.max_range, parameters.min_range)
            said = space.segment(frame.points_level[is_moving], _pose(frame.origin_level), cloud_transform=False)
            is_moving[is_moving] = np.asarray(said) > 0
            yield k, is_moving


def _pose(origin: np.ndarray) -> list[float]:
    return [*map(float, origin), 1.0, 0.0, 0.0, 0.0]
