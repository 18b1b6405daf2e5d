"""DUFOMap: what was ever inside space that was seen to be empty throughout has moved.

Duberg, Zhang, Jia, Jensfelt, "DUFOMap: Efficient Dynamic Awareness Mapping" (RA-L 2024), by the authors' own library.
A voxel is empty if rays went through all of it and its surroundings, hits inflated by `d_s`, the unknown by `d_p`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator

import numpy as np

from automos.baselines.batches import cut_batches, is_within
from automos.errors import MissingExtraError
from automos.extras import pip_install
from automos.scan import Frames, Mask
from automos.settings import DufomapSettings


def find_moving(frames: Frames, settings: DufomapSettings, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order.

    Raises
    ------
    MissingExtraError
        The library is not installed.
    """
    os.environ.setdefault("GLOG_minloglevel", "1")  # else it reports its parameters on the terminal, batch by batch
    try:
        dufomap = importlib.import_module("dufomap").dufomap
    except ImportError:
        raise MissingExtraError(f"dufomap is not installed; run: {pip_install('dufomap')}") from None
    for batch in cut_batches(frames, settings.batch, start):
        space = dufomap(settings.resolution, settings.d_s, settings.d_p)
        for k in batch.frames:
            frame = frames[k]
            used = is_within(frame, settings.max_range, settings.min_range)
            space.run(frame.points_level[used], _pose(frame.origin_level), cloud_transform=False)
        space.oncePropagateCluster(if_propagate=True, if_cluster=False)
        for k in batch.own:
            frame = frames[k]
            is_moving = is_within(frame, settings.max_range, settings.min_range)
            said = space.segment(frame.points_level[is_moving], _pose(frame.origin_level), cloud_transform=False)
            is_moving[is_moving] = np.asarray(said) > 0
            yield k, is_moving


def _pose(origin: np.ndarray) -> list[float]:
    return [*map(float, origin), 1.0, 0.0, 0.0, 0.0]
