"""KITTI odometry and SemanticKITTI: sequences/SS/{velodyne, labels, poses.txt, calib.txt, times.txt}, and relatives.

Poses are the left camera's in KITTI's own files; calib.txt carries them over to the sensor, and without one they are
taken as the sensor's. Many other recordings are published in this layout, so nothing is assumed of the sensor.

HeLiMOS has the layout for each of four sensors, and labels for some of the scans: those in train, val and test.txt.
SemanticPOSS has tag/*.tag beside, and classes of its own numbers. It says what things are, not whether they move: what
cannot move is static; people, riders, cars and bikes have no truth.

KITTI's tracking benchmark: training/velodyne/SSSS/*.bin, label_02/SSSS.txt, calib/SSSS.txt, oxts/SSSS.txt.
"""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import Array, inverse, transform
from automos.core.labels import Label
from automos.core.reading import damage_reported, is_there, read_text
from automos.core.scan import Pose
from automos.readers.box_truth import DrawnBoxes, checked_boxes
from automos.readers.files import natural_key
from automos.readers.folder import FolderSequence
from automos.readers.formats import Format, recordings_in, require_increasing
from automos.readers.kitti_calibration import IMAGE_SIZE, PACKET, Calibration, Camera, KittiTruth, poses_from_packets
from automos.readers.records import read_table
from automos.readers.stamped_poses import sensor_poses

_SCANS = "velodyne"


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, or those of a dataset root (in `sequences/` or directly) by name."""
    if _is_kitti(path):
        return [path]
    found = recordings_in(_within(path, "sequences"), lambda p: not p.name.startswith(".") and _is_kitti(p))
    return sorted(found, key=lambda p: natural_key(p.name))


def _is_kitti(path: Path) -> bool:
    return (path / _SCANS).is_dir()


def _within(path: Path, name: str) -> Path:
    """Return the folder of this name in `path`, else `path` itself, which may be that folder."""
    return path / name if (path / name).is_dir() else path


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
    if _is_kitti(path) and _has_splits(path.resolve().parent):
        return [path]
    root = _within(path, "Deskewed_LiDAR")
    return recordings_in(root, _is_kitti) if _has_splits(root) else []


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


class SemanticPossSequence(KittiSequence):
    """One sequence."""

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return (N,) uint32: STATIC for what cannot move, UNLABELED for all else, ids in the upper 16 bits."""
        packed = super().truth(index)
        if packed is None:
            return None
        label = np.where(np.isin(packed & 0xFFFF, _STATIC), Label.STATIC, Label.UNLABELED)
        return (packed & np.uint32(0xFFFF0000)) | label.astype(np.uint32)


_PERIOD = 0.1
"""Seconds between scans; the benchmark gives no times."""
_WORDS = (17, 18)
"""Of a line about a box; some programs add a score."""


def _find_tracking(path: Path) -> list[Path]:
    """Return the sequences at `path`: itself, or those of a split or of the root, by name."""
    if path.is_dir() and path.parent.name == _SCANS and is_there(_calib_of(path)):
        return [path]
    root = path / "training" if _is_kitti(path / "training") else path
    return recordings_in(root / _SCANS, lambda p: p.is_dir() and is_there(_calib_of(p)))


def _calib_of(path: Path) -> Path:
    return path.parent.parent / "calib" / f"{path.name}.txt"


class KittiTrackingSequence(KittiTruth, FolderSequence):
    """One sequence; scans are matched to labels and poses by their number."""

    is_compensated = False
    """Sweeps are as measured."""

    def __init__(self, source: Path):
        """List the scans in folder `source`."""
        super().__init__(source, codec="bin")

    def _read_times(self, stamps_from_names: Array | None) -> Array:
        self._require_numbered(self.source)
        times: Array = _PERIOD * self._frames.astype(np.float64)
        require_increasing(times, self._names, self.source)
        return times

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor from GPS and IMU; None without its packets."""
        path = self._oxts
        if not is_there(path):
            return None
        packets = read_table(path, PACKET, "poses")
        if len(packets) <= self._frames.max():
            raise InputError(f"{path} holds {len(packets)} poses, but there is a scan {self._names[-1]}; copy it again")
        T_sensor_imu = self._calibration.transform("Tr_imu_velo", "Tr_imu_to_velo")
        return sensor_poses(poses_from_packets(packets[self._frames], path), inverse(T_sensor_imu))

    # ------------------------------------------------------------------------------------------------- files beside
    def _beside(self, folder: str) -> Path:
        return self.source.resolve().parent.parent / folder / f"{self.source.name}.txt"

    @property
    def _oxts(self) -> Path:
        return self._beside("oxts")

    @cached_property
    def _calibration(self) -> Calibration:
        return Calibration(_calib_of(self.source))

    @cached_property
    def _T_rectified_sensor(self) -> Pose:
        calibration = self._calibration
        return calibration.rotation("R_rect", "R0_rect") @ calibration.transform("Tr_velo_cam", "Tr_velo_to_cam")

    @cached_property
    def _camera(self) -> Camera:
        projection = self._calibration.row("P2", size=12).reshape(3, 4)
        return self._T_rectified_sensor, projection, IMAGE_SIZE

    @cached_property
    def _drawn(self) -> DrawnBoxes | None:
        path = self._beside("label_02")
        if not is_there(path):
            return None
        with damage_reported(path, "is not a file of KITTI's tracking labels", "download it again"):
            words = [line.split() for line in read_text(path).splitlines() if line.strip()]
            if any(len(row) not in _WORDS for row in words):
                raise ValueError("a line of another number of words")
            objects = [row for row in words if row[2] != "DontCare"]
            numbers = np.array([row[:2] for row in objects], np.int64).reshape(-1, 2)
            table = np.array([row[10:17] for row in objects], np.float64).reshape(-1, 7)
        in_camera = checked_boxes(table[:, 3:6], table[:, [2, 1, 0]], table[:, 6], path)
        T_sensor_rectified = inverse(self._T_rectified_sensor)
        # The box's place is the middle of its underside, the y-axis points down, and it is turned about that.
        raised = in_camera.center - np.outer(0.5 * in_camera.size[:, 2], [0.0, 1.0, 0.0])
        turn = in_camera.yaw
        heading = np.column_stack([np.cos(turn), np.zeros(len(turn)), -np.sin(turn)]) @ T_sensor_rectified[:3, :3].T
        yaw = np.arctan2(heading[:, 1], heading[:, 0])
        boxes = replace(in_camera, center=transform(T_sensor_rectified, raised), yaw=yaw)
        return self._in_scans(numbers[:, 0], numbers[:, 1] + 1, boxes)


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
        find=lambda path: [recording for recording in find(path) if (recording / "tag").is_dir()],
        open=SemanticPossSequence,
    ),
    "kitti_tracking": Format(
        layout="KITTI tracking: training/velodyne/SSSS/, calib/SSSS.txt, label_02/, oxts/",
        truth="label_02/SSSS.txt, where the left colour camera sees",
        find=_find_tracking,
        open=KittiTrackingSequence,
    ),
}
