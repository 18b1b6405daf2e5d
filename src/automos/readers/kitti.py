"""KITTI odometry and SemanticKITTI: sequences/SS/{velodyne, labels, poses.txt, calib.txt, times.txt}, and relatives.

Poses are the left camera's in KITTI's own files; calib.txt carries them over to the sensor, and without one they are
taken as the sensor's. Many other recordings are published in this layout, so nothing is assumed of the sensor.

HeLiMOS has the layout for each of four sensors, and labels for some of the scans: those in train, val and test.txt.
SemanticPOSS has tag/*.tag beside, and classes of its own numbers. It says what things are, not whether they move: what
cannot move is static; people, riders, cars and bikes have no truth.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.reading import is_there
from automos.readers.files import natural_key
from automos.readers.folder import FolderSequence
from automos.readers.formats import Format

_SCANS = "velodyne"


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, or those of a dataset root (in `sequences/` or directly) by name."""
    if (path / _SCANS).is_dir():
        return [path]
    root = path / "sequences" if (path / "sequences").is_dir() else path
    if not root.is_dir():
        return []
    return sorted(
        (p for p in root.iterdir() if not p.name.startswith(".") and (p / _SCANS).is_dir()),
        key=lambda p: natural_key(p.name),
    )


class KittiSequence(FolderSequence):
    """One sequence in KITTI's layout."""

    def __init__(self, source: Path, codec: str | None = None):
        """List the scans in `source / velodyne`; errors are those of a plain folder."""
        super().__init__(source, codec, _SCANS)

    def _pose_files(self) -> list[Path]:
        # KITTI itself keeps the poses of sequences/SS in poses/SS.txt of the root.
        source = self.source.resolve()
        return [*super()._pose_files(), source.parent.parent / "poses" / f"{source.name}.txt"]


_SPLITS = ("train.txt", "val.txt", "test.txt")


def _find_helimos(path: Path) -> list[Path]:
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

    is_compensated = True
    """Published without the sensor's motion during a sweep."""

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) uint32 labels of scan `index`, None where it was not labelled."""
        name = self.names[self._scan_number(index)]
        return super().truth(index) if is_there(self.source / "labels" / f"{name}.label") else None


_STATIC = (8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 22)
"""Trunk, plants, traffic signs, pole, trashcan, building, cone, fence, ground."""


def _find_semanticposs(path: Path) -> list[Path]:
    """Return the recordings at `path` that have tags."""
    return [recording for recording in find(path) if (recording / "tag").is_dir()]


class SemanticPossSequence(KittiSequence):
    """One sequence."""

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return (N,) uint32: STATIC for what cannot move, UNLABELED for all else, ids in the upper 16 bits."""
        packed = super().truth(index)
        if packed is None:
            return None
        label = np.where(np.isin(packed & 0xFFFF, _STATIC), Label.STATIC, Label.UNLABELED)
        return (packed & np.uint32(0xFFFF0000)) | label.astype(np.uint32)


FORMATS = {
    "kitti": Format(
        layout="KITTI's layout (odometry, SemanticKITTI): velodyne/, and where present poses.txt, calib.txt, times.txt",
        truth="labels/*.label",
        find=find,
        open=KittiSequence,
        has_codecs=True,
    ),
    "helimos": Format(
        layout="HeLiMOS: train.txt, val.txt, test.txt and per sensor velodyne/, labels/, poses.txt",
        truth="labels/*.label of the listed scans",
        find=_find_helimos,
        open=HelimosSequence,
    ),
    "semanticposs": Format(
        layout="SemanticPOSS: KITTI's layout and tag/*.tag",
        truth="static classes of labels/*.label; what moves is not labelled",
        find=_find_semanticposs,
        open=SemanticPossSequence,
    ),
}
