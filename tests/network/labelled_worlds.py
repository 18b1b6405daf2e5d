"""Tiny labelled recordings on disk, and a stand-in for a network that needs nothing installed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from worlds import World, write_bins

from automos.core.label_files import pack
from automos.core.pose_writers import write_kitti
from automos.network.deployed import Deployed
from automos.network.images import BASE_CHANNELS
from automos.settings import ImageSettings, Settings, load_settings

IMAGE = {"network.image.height": 16, "network.image.width": 128, "network.image.residuals": 3}
SMALL = {
    **IMAGE,
    "network.model.channels": 4,
    "network.training.batch": 2,
    "network.training.epochs": 2,
    "odometry.time": "none",
}


def settings(**changed: object) -> Settings:
    """Return settings of a tiny network; `training_epochs=3` stands for network.training.epochs."""
    return load_settings("default", overrides={**SMALL, **{f"network.training.{k}": v for k, v in changed.items()}})


def write_labelled(world: World, folder: Path, labels: Sequence[np.ndarray] | None = None) -> Path:
    """Write `world` as a KITTI sequence with its truth, or `labels`, into `folder`; return the folder."""
    write_bins(world.sequence, folder / "velodyne")
    write_kitti(folder / "poses.txt", world.poses)
    (folder / "labels").mkdir()
    for name, label in zip(world.sequence.names, labels or world.truth, strict=True):
        pack(label).tofile(folder / "labels" / f"{name}.label")
    return folder


def changes_move(threshold: float = 0.3) -> Deployed:
    """Return a network that calls a pixel moving where one of the earlier scans saw through its place."""

    def run(image: np.ndarray) -> np.ndarray:
        return (image[len(BASE_CHANNELS) :].max(axis=0) > threshold).astype(np.float32)

    return Deployed(ImageSettings(height=16, width=128, residuals=3), run, "a threshold", {"made": "by hand"})
