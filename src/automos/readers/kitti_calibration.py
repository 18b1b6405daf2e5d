"""What KITTI's own recordings say of cameras and vehicle: calibration files, GPS/IMU packets, and the camera's view.

Boxes were drawn only where the left colour camera sees; elsewhere nobody knows what moved.
"""

from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST, make_transform, transform
from automos.core.labels import Label
from automos.core.pose_files import text_of
from automos.core.scan import Array, Ints, Mask, Points, Pose, Scan
from automos.core.upright_boxes import Boxes
from automos.readers.box_truth import DrawnBoxes, DrawnTruth, centers_in_world, judge_boxes
from automos.readers.stamped_poses import from_rows, rigid_transforms

PACKET = 30
"""Numbers in a GPS/IMU packet."""
EARTH_RADIUS = 6378137.0
_MOST = np.array([89.0, 360.0, 1e5, 7.0, 7.0, 7.0])
"""Latitude and longitude, degrees, altitude, metres, and roll, pitch and yaw, radians: beyond are not vehicles."""
Camera = tuple[Pose, Array, tuple[float, float]]
"""T_rectified_sensor (4, 4), the (3, 4) projection from there to pixels, and the picture's width and height."""
IMAGE_SIZE = (1242, 375)
"""Pixels, width and height, of the rectified pictures where the calibration does not say."""


class Calibration:
    """The rows of numbers of a calibration file; rows of anything else are left out."""

    def __init__(self, path: Path):
        """Read it; InputError where it is absent or cannot be read."""
        lines = text_of(path, "is missing; download the calibration that belongs to the recording").splitlines()
        self._path, self._rows = path, dict[str, Array]()
        for line in lines:
            name, *words = line.replace(":", " ", 1).split() or [""]
            with suppress(ValueError):  # the date of the calibration
                self._rows[name] = np.array(words, np.float64)

    def row(self, *names: str, size: int) -> Array:
        """Return the row of the first of `names` that is there, of `size` numbers."""
        row = next((self._rows[name] for name in names if name in self._rows), None)
        if row is None or len(row) != size:
            raise InputError(f"{self._path} has no line {names[0]!r} of {size} numbers; download the calibration again")
        if not (np.abs(row) < FARTHEST).all():
            raise InputError(
                f"{self._path}: line {names[0]!r} holds what is not a number; download the calibration again"
            )
        return row

    def transform(self, *names: str) -> Pose:
        """Return (4, 4) of such a row of 12 numbers."""
        return from_rows(self.row(*names, size=12), self._path)[0]

    def rotation(self, *names: str, to: str | None = None) -> Pose:
        """Return (4, 4) of such a row of 9 numbers; with the translation of 3 numbers that `to` names."""
        R = self.row(*names, size=9).reshape(3, 3)
        T = rigid_transforms(make_transform(R)[None], self._path)[0]
        return T if to is None else make_transform(T[:3, :3], self.row(to, size=3))


def poses_from_packets(packets: Array, path: Path) -> Pose:
    """Return (N, 4, 4) T_map_imu of GPS/IMU packets (N, 6 or more): latitude, longitude, altitude, roll, pitch, yaw.

    Latitude and longitude in degrees are projected by Mercator at the first one's latitude, as KITTI's own tools do.

    Raises
    ------
    InputError
        A packet that is of no place on Earth; `path` is what they came from.
    """
    from scipy.spatial.transform import Rotation

    is_on_earth = np.abs(packets[:, :6]) <= _MOST
    if not is_on_earth.all():
        bad = int(np.argmin(is_on_earth.all(axis=1)))
        raise InputError(f"{path}: packet {bad} is of no place on Earth; download it again")
    latitude, longitude, altitude = packets[:, :3].T
    scale = np.cos(np.radians(latitude[0])) * EARTH_RADIUS
    north = scale * np.log(np.tan(np.radians(90.0 + latitude) / 2.0))
    place = np.column_stack([scale * np.radians(longitude), north, altitude])
    return make_transform(Rotation.from_euler("xyz", packets[:, 3:6]).as_matrix(), place)


def in_view(points: Points, T_rectified_sensor: Pose, projection: Array, size: tuple[float, float]) -> Mask:
    """Return (N,) bool: whether the camera sees each of `points` (N, 3), sensor frame.

    Parameters
    ----------
    T_rectified_sensor : (4, 4) to the frame of the rectified cameras, z forward.
    projection : (3, 4) from there to pixels.
    size : width and height of the picture, pixels.
    """
    ahead = transform(T_rectified_sensor, points.astype(np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = ahead @ projection[:, :3].T + projection[:, 3]
        u, v = pixels[:, 0] / pixels[:, 2], pixels[:, 1] / pixels[:, 2]
        return (ahead[:, 2] > 0.0) & (u >= 0) & (u < size[0]) & (v >= 0) & (v < size[1])


class KittiTruth(DrawnTruth):
    """A recording of KITTI's own, in which boxes were drawn where the left colour camera sees.

    Readers derive from it, and say which these are and where the camera is.
    """

    @property
    def _drawn(self) -> DrawnBoxes | None:
        """The boxes of all scans by index, in the sensor's frame; None of a recording without."""
        raise NotImplementedError

    @property
    def _camera(self) -> Camera:
        raise NotImplementedError

    @property
    def _oxts(self) -> Path:
        """Where the packets of GPS and IMU lie, from which the poses are."""
        raise NotImplementedError

    def _boxes_of(self, index: int) -> tuple[DrawnBoxes, Pose] | None:
        return None if self._drawn is None else (self._drawn.of(index), np.eye(4))

    def _judged(self, index: int, scan: Scan, labels: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
        """Return the labels of what the camera sees: nobody drew boxes elsewhere."""
        return np.where(in_view(scan.points, *self._camera), labels, np.uint32(Label.UNLABELED))

    def _in_scans(self, frame: Ints, track: Ints, boxes: Boxes) -> DrawnBoxes:
        """Return those of R boxes in the sensor's frame, by the number of a frame (R,), of which there is a scan."""
        frames, stamps = self._frames, self.stamps
        scan = np.searchsorted(frames, frame).clip(0, len(frames) - 1)
        rows = np.flatnonzero(frames[scan] == frame)
        scan, track, boxes = scan[rows], track[rows], boxes[rows]
        poses = self.reference_poses
        if poses is None:
            raise InputError(f"{self._oxts} is missing; without poses it is not known which boxes move")
        seconds = 0.1 * frame[rows].astype(np.float64) if stamps is None else stamps[scan]
        return DrawnBoxes(scan, track, boxes, judge_boxes(track, seconds, centers_in_world(poses[scan], boxes.center)))

    @property
    def _frames(self) -> Ints:
        """(len,) the scans' numbers, which are their names."""
        return np.array([int(name) for name in self.names])

    def _require_numbered(self, folder: Path) -> None:
        """Raise InputError where a scan in `folder` is not named by its number."""
        stray = next((name for name in self.names if not (name.isascii() and name.isdecimal())), None)
        if stray is not None:
            raise InputError(f"{folder} has a scan named {stray!r}; KITTI names scans by their number")
