"""Data sets with a file of poses on a clock of its own: Apollo SouthBay, Boreas, HeLiPR, MulRan.

Scans of the last three are files named by their time, of one kind of record. What differs is in a `Drive`: where the
files lie, what a point holds, and how the poses that came with them are told. HeLiPR's sensors are recordings of their
own, and every point has its time. MulRan's clouds are 64 x 1024, column after column, so that a point's place gives its
beam and time; a few files are incomplete, and those have neither. Apollo's are point files, with the number, time and
pose of each in poses/gt_poses.txt; its labelled version is in KITTI's layout and read as that.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import Array, make_transform
from automos.core.reading import is_there
from automos.core.scan import Pose, Scan
from automos.readers.codecs import parse_columns
from automos.readers.columns import Columns
from automos.readers.folder import FolderSequence
from automos.readers.formats import Format, recordings_at
from automos.readers.listed import ListedSequence, stamped_files
from automos.readers.records import read_records, read_table
from automos.readers.stamped_poses import from_quaternions, from_rotations, from_rows, poses_at, sensor_poses

_AEVA = "x,y,z,_,_,t:i4,line:u1"
_SENSORS = {
    "Aeva": f"{_AEVA},intensity",
    "Avia": "x,y,z,reflectivity:u1,_:u1,line:u1,t:u4",
    "Ouster": "x,y,z,intensity,t:u4,_:u2,ring:u2,_:u2",
    "Velodyne": "x,y,z,intensity,ring:u2,time",
}
_LAST_WITHOUT_INTENSITY = 1691936557946849179
"""Nanoseconds: up to this scan the Aeva was recorded without intensity."""
_BEAMS, _COLUMNS, _PERIOD = 64, 1024, 0.1


@dataclass(frozen=True)
class Drive:
    """A data set.

    Attributes
    ----------
    scans, poses : the folder of the scans in a recording, and the file of poses.
    tick : seconds that the files' names count.
    read : returns the columns of the file of a scan.
    place : returns (N, 4, 4) T_map_body from what the file of poses has, (N, `width`), behind their times.
    width, divider, has_names : of the file of poses: numbers a line, what divides them, whether the first line is none.
    mount : returns (4, 4) T_body_sensor; none: the poses are the sensor's.
    """

    scans: str
    poses: str
    tick: float
    read: Callable[[Path], Columns]
    place: Callable[[Array, Path], Pose]
    width: int = 12
    divider: str | None = ","
    has_names: bool = False
    mount: Callable[[], Pose] | None = None

    def is_recording(self, path: Path) -> bool:
        """Return whether `path` is one."""
        return (path / self.scans).is_dir() and is_there(path / self.poses)


class DriveSequence(ListedSequence):
    """One recording of one sensor."""

    def __init__(self, source: Path, drive: Drive, name: str | None = None):
        """List the scans of the recording in folder `source`."""
        files, stamps = stamped_files(source / drive.scans, ".bin", drive.tick)
        super().__init__(source, files, stamps, name)
        self._drive = drive

    def __getitem__(self, index: int) -> Scan:
        columns = self._drive.read(self.paths[index := self._scan_number(index)])
        return self._to_scan(index, columns, 1e-9 if "t" in columns else 1.0)

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor from the data set's own poses; None without them."""
        drive, path = self._drive, self.source / self._drive.poses
        if not is_there(path):
            return None
        table = read_table(path, 1 + drive.width, "poses", drive.divider, drive.has_names)
        T = poses_at(self.stamps, drive.tick * table[:, 0], drive.place(table[:, 1:], path), path)
        return sensor_poses(T, None if drive.mount is None else drive.mount())


def _boreas_columns(path: Path) -> Columns:
    return read_records(path, parse_columns("x,y,z,intensity,ring,time"))


def _mulran_columns(path: Path) -> Columns:
    columns = read_records(path, parse_columns("x,y,z,intensity"))
    if len(columns["x"]) == _BEAMS * _COLUMNS:
        place = np.arange(_BEAMS * _COLUMNS)
        columns |= {"ring": place % _BEAMS, "time": (place // _BEAMS) * (_PERIOD / _COLUMNS)}
    return columns


def _mulran_mount() -> Pose:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", [0.0001, 0.0003, 179.6654], degrees=True).as_matrix()
    return make_transform(turn, [1.7042, -0.021, 1.8047])  # published with the data set


def _boreas_poses(rows: Array, path: Path) -> Pose:
    from scipy.spatial.transform import Rotation

    R = Rotation.from_euler("xyz", rows[:, 6:9]).as_matrix().transpose(0, 2, 1)  # as its own tools turn
    return from_rotations(R, rows[:, :3], path)


def _helipr_columns(sensor: str, path: Path) -> Columns:
    is_short = sensor == "Aeva" and int(path.stem) <= _LAST_WITHOUT_INTENSITY
    return read_records(path, parse_columns(_AEVA if is_short else _SENSORS[sensor]))


def _quaternions(rows: Array, path: Path) -> Pose:
    return from_quaternions(rows[:, :3], rows[:, 3:], path)


MULRAN = Drive("Ouster", "global_pose.csv", 1e-9, _mulran_columns, from_rows, mount=_mulran_mount)
BOREAS = Drive("lidar", "applanix/lidar_poses.csv", 1e-6, _boreas_columns, _boreas_poses, has_names=True)


def _find_helipr(path: Path) -> list[Path]:
    """Return the sensors' folders at `path`: itself, or those of a drive, by name."""
    if path.name in _SENSORS and path.parent.name == "LiDAR" and path.is_dir():
        return [path]
    return [path / "LiDAR" / name for name in _SENSORS if (path / "LiDAR" / name).is_dir()]


def _open_helipr(source: Path) -> DriveSequence:
    sensor, place = source.resolve().name, source.resolve()
    poses, read = f"../../LiDAR_GT/{sensor}_gt.txt", partial(_helipr_columns, sensor)
    drive = Drive(".", poses, 1e-9, read, _quaternions, width=7, divider=None)
    return DriveSequence(source, drive, f"{place.parent.parent.name}_{sensor}")


def _format(layout: str, drive: Drive) -> Format:
    return Format(layout, partial(recordings_at, is_recording=drive.is_recording), partial(DriveSequence, drive=drive))


_SCANS, _POSES = "pcds", Path("poses") / "gt_poses.txt"


class ApolloSequence(FolderSequence):
    """One run; scans are matched to poses by their number."""

    def __init__(self, source: Path):
        """List the scans of the run in folder `source`."""
        super().__init__(source, "pcd", _SCANS)

    def _read_times(self, stamps_from_names: Array | None) -> Array | None:
        try:
            return self._rows()[:, 1]
        except InputError:
            return None  # labels need no poses, and points may have times; asking for the poses raises the error

    @cached_property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) T_world_sensor.

        Raises
        ------
        InputError
            A scan without a pose, or with one of another time than that of its points.
        """
        rows = self._rows()
        stamps = rows[:, 1] if self.stamps is None else self.stamps
        is_off = np.abs(rows[:, 1] - stamps) > 1.0
        if is_off.any():
            first = int(np.argmax(is_off))
            raise InputError(
                f"{self.source / _POSES} has the pose of {self._names[first]}.pcd at {rows[first, 1]:.3f} s, but its "
                f"points are of {stamps[first]:.3f} s; it belongs to another run"
            )
        return sensor_poses(_quaternions(rows[:, 2:], self.source / _POSES))

    def _rows(self) -> Array:
        """Return (len, 9) of each scan: number, seconds, x, y, z, qx, qy, qz, qw."""
        table = read_table(self.source / _POSES, 9, "poses")
        row_of = {int(number): row for row, number in enumerate(table[:, 0])}
        missing = next((name for name in self._names if not name.isdecimal() or int(name) not in row_of), None)
        if missing is not None:
            raise InputError(f"{self.source / _POSES} has no pose for scan {missing}.pcd; it belongs to another run")
        return table[[row_of[int(name)] for name in self._names]]


FORMATS = {
    "helipr": Format(
        layout="HeLiPR: LiDAR/{Aeva,Avia,Ouster,Velodyne}/*.bin, LiDAR_GT/; each sensor is a recording",
        find=_find_helipr,
        open=_open_helipr,
    ),
    "mulran": _format("MulRan: Ouster/*.bin, global_pose.csv", MULRAN),
    "boreas": _format("Boreas: lidar/*.bin, applanix/lidar_poses.csv", BOREAS),
    "apollo": Format(
        layout="Apollo SouthBay: pcds/*.pcd, poses/gt_poses.txt",
        find=partial(recordings_at, is_recording=lambda path: (path / _SCANS).is_dir() and is_there(path / _POSES)),
        open=ApolloSequence,
    ),
}
