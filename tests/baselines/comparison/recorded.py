"""Tiny worlds as recordings on disk, with their truth."""

from pathlib import Path

import numpy as np
from worlds import World, write_bins


def write_recording(world: World, folder: Path, with_truth: bool = True) -> Path:
    """Write `world` in KITTI's layout; return the sequence's folder."""
    write_bins(world.sequence, folder / "velodyne")
    if with_truth:
        (folder / "labels").mkdir(parents=True)
        for scan, truth in zip(world.sequence, world.truth, strict=True):
            truth.astype(np.uint32).tofile(folder / "labels" / f"{scan.name}.label")
    np.savetxt(folder / "times.txt", world.sequence.stamps)
    return folder
