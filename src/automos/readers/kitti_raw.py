"""KITTI raw drives, "road" ones too: DATE/DATE_drive_NNNN_sync with velodyne_points/, oxts/ and tracklet_labels.xml.

KITTI-360 and VBR's converter lay scans out alike, with poses of their own. Sweeps are as measured, not
motion-compensated. The day's calibration lies beside its drives.
"""

from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import inverse
from automos.core.pose_files import interpolate_poses, read_poses
from automos.core.reading import damage_reported, is_there, read_bytes
from automos.core.scan import Array, Pose
from automos.readers.box_truth import DrawnBoxes, checked_boxes
from automos.readers.folder import FolderSequence
from automos.readers.formats import Format, require_increasing
from automos.readers.kitti_calibration import PACKET, Calibration, Camera, KittiTruth, poses_from_packets
from automos.readers.records import read_table
from automos.readers.scan_times import read_times
from automos.readers.stamped_poses import from_rows, sensor_poses, truth_beside

_SCANS = ("velodyne_points/data", "ouster_points/data")
"""Of KITTI and KITTI-360, and of VBR's converter."""
_BOXES = "tracklet_labels.xml"


def find(path: Path) -> list[Path]:
    """Return the drives at `path`: itself, those of its day, or those of all days in it, by name."""
    if _scans_of(path) is not None:
        return [path]
    if not path.is_dir():
        return []
    below = (scans for place in _SCANS for start in ("*", "*/*") for scans in path.glob(f"{start}/{place}"))
    return sorted({scans.parent.parent for scans in below})


def _scans_of(path: Path) -> str | None:
    return next((place for place in _SCANS if (path / place).is_dir()), None)


class KittiRawSequence(KittiTruth, FolderSequence):
    """One drive."""

    is_compensated = False
    """Raw drives are as measured."""

    def __init__(self, source: Path):
        """List the scans of the drive in folder `source`; errors are those of a plain folder."""
        super().__init__(source, scan_folder=_scans_of(source) or _SCANS[0])
        self._require_numbered(self._folder)

    def _read_times(self, stamps_from_names: Array | None) -> Array | None:
        path = self._folder.parent / "timestamps.txt"
        if not is_there(path):
            return None
        times = read_times(path, self._names)
        require_increasing(times, self._names, path)
        return times

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor from GPS and IMU, or the poses published with KITTI-360 or VBR; None without."""
        if not (self._oxts / "data").is_dir():
            return self._published_poses()
        path = self.source.resolve().parent / "calib_imu_to_velo.txt"
        return sensor_poses(self._T_map_imu, inverse(Calibration(path).rotation("R", to="T")))

    def _published_poses(self) -> Pose | None:
        told = truth_beside(self.source, self.source.resolve().name)
        if told is not None:
            return read_poses(told, len(self), self.stamps)
        root, drive = self.source.resolve().parent.parent, self.source.resolve().name
        path = root / "data_poses" / drive / "poses.txt"
        if not is_there(path):
            return None
        table, calibration = read_table(path, 13, "poses"), root / "calibration"
        T_velo_camera = from_rows(read_table(calibration / "calib_cam_to_velo.txt", 12, "a pose")[0], calibration)[0]
        T_pose_camera = Calibration(calibration / "calib_cam_to_pose.txt").transform("image_00")
        # none was published of frames in which the car stood
        T = interpolate_poses(table[:, 0], from_rows(table[:, 1:], path), self._frames.astype(np.float64))
        return sensor_poses(T, T_pose_camera @ inverse(T_velo_camera))

    # ------------------------------------------------------------------------------------------------- files beside
    @property
    def _oxts(self) -> Path:
        return self.source / "oxts"

    @cached_property
    def _T_map_imu(self) -> Pose:
        folder = self._oxts / "data"
        packets = [read_table(folder / f"{name}.txt", PACKET, "poses") for name in self._names]
        twice = next((name for name, rows in zip(self._names, packets, strict=True) if len(rows) > 1), None)
        if twice is not None:
            raise InputError(f"{folder / twice}.txt holds more than one packet, the scan's; copy it again")
        return poses_from_packets(np.concatenate(packets), folder)

    @cached_property
    def _camera(self) -> Camera:
        return self.camera(2)

    def camera(self, number: int) -> Camera:
        """Return T_rectified_sensor (4, 4), the (3, 4) projection from there to pixels, and the picture's size.

        number : 2 of the left colour camera, 3 of the right one.
        """
        day = self.source.resolve().parent
        camera = Calibration(day / "calib_cam_to_cam.txt")
        T = camera.rotation("R_rect_00") @ Calibration(day / "calib_velo_to_cam.txt").rotation("R", to="T")
        width, height = camera.row(f"S_rect_{number:02d}", size=2)
        return T, camera.row(f"P_rect_{number:02d}", size=12).reshape(3, 4), (float(width), float(height))

    def picture(self, number: int, index: int) -> Path:
        """Return where the picture of camera `number` that belongs to scan `index` lies."""
        return self.source / f"image_{number:02d}" / "data" / f"{self._names[index]}.png"

    @cached_property
    def _drawn(self) -> DrawnBoxes | None:
        path = self.source / _BOXES
        if not is_there(path):
            return None
        with damage_reported(path, "is not a complete file of tracklets", "download it again"):
            items = ElementTree.fromstring(read_bytes(path)).findall("tracklets/item")
            rows = [row for k, item in enumerate(items, start=1) for row in _rows_of(item, k)]
            table = np.array(rows, np.float64).reshape(-1, 9)
        drawn = checked_boxes(table[:, 2:5], table[:, 5:8], table[:, 8], path)
        return self._in_scans(table[:, 1].astype(np.int64), table[:, 0].astype(np.int64), drawn)


def _rows_of(item: ElementTree.Element, track: int) -> list[list[float]]:
    """Return a tracklet's boxes: track, frame, centre, length, width, height, yaw; KITTI gives the bottom's centre."""
    height, width, length = (float(str(item.findtext(side))) for side in ("h", "w", "l"))
    first = int(str(item.findtext("first_frame")))
    rows = []
    for k, pose in enumerate(item.findall("poses/item")):
        x, y, z, yaw = (float(str(pose.findtext(name))) for name in ("tx", "ty", "tz", "rz"))
        rows.append([track, first + k, x, y, z + 0.5 * height, length, width, height, yaw])
    return rows


FORMAT = Format(
    layout="KITTI raw drive: velodyne_points/data/, timestamps.txt, oxts/, calib_*.txt; KITTI-360, VBR alike",
    truth="tracklet_labels.xml, where the left colour camera sees",
    find=find,
    open=KittiRawSequence,
)
