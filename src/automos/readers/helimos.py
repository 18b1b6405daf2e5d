"""HeLiMOS: KITTI's layout for each of four sensors, labels for some of the scans: those in train, val and test.txt."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.reading import is_there
from automos.readers.formats import Format
from automos.readers.kitti import KittiSequence

_SPLITS = ("train.txt", "val.txt", "test.txt")


def find(path: Path) -> list[Path]:
    """Return the sensors' folders at `path`: itself, or those beside the lists of labelled scans, by name."""
    if (path / "velodyne").is_dir() and _has_splits(path.resolve().parent):
        return [path]
    root = path / "Deskewed_LiDAR" if (path / "Deskewed_LiDAR").is_dir() else path
    if not root.is_dir() or not _has_splits(root):
        return []
    return sorted(p for p in root.iterdir() if (p / "velodyne").is_dir())


def _has_splits(folder: Path) -> bool:
    return any(is_there(folder / name) for name in _SPLITS)


class HelimosSequence(KittiSequence):
    """One sensor; scans without a label file have no truth."""

    @property
    def is_compensated(self) -> bool:
        """Published without the sensor's motion during a sweep."""
        return True

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) uint32 labels of scan `index`, None where it was not labelled."""
        name = self.names[self._scan_number(index)]
        return super().truth(index) if is_there(self.source / "labels" / f"{name}.label") else None


FORMAT = Format(
    layout="HeLiMOS: train.txt, val.txt, test.txt and per sensor velodyne/, labels/, poses.txt",
    truth="labels/*.label of the listed scans",
    find=find,
    open=HelimosSequence,
)
