"""Argoverse 2 Sensor logs: sensors/lidar/*.feather, calibration, ego poses, boxes, and per-point flow where it is.

The files hold the points of both 32-beam sensors in the vehicle's frame, at one time. The points are transformed to the
frame of the upper sensor. The laser number says which of the two measured a point, and so where its ray starts.
"""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.geometry import Array, inverse, transform
from automos.core.label_files import pack
from automos.core.labels import Label
from automos.core.reading import damage_reported, is_there
from automos.core.scan import Pose, Scan
from automos.readers.apart import read_apart
from automos.readers.box_truth import DrawnBoxes, DrawnTruth, checked_boxes, motion_with_boxes
from automos.readers.formats import Format, recordings_at
from automos.readers.listed import ListedSequence, stamped_files
from automos.readers.parquet import arrow_reported
from automos.readers.stamped_poses import checked_mount, from_quaternions, poses_at, sensor_poses

_SCANS = Path("sensors") / "lidar"
_CALIBRATION = Path("calibration") / "egovehicle_SE3_sensor.feather"
_POSES = "city_SE3_egovehicle.feather"
_BOXES = "annotations.feather"
_FLOW = "flow_labels.feather"
_SENSORS = ("up_lidar", "down_lidar")
_LASERS = 32
"""Of each of the two."""
_WORDS = {"sensor_name", "track_uuid", "category"}
"""Columns that hold no numbers."""


class Table(dict[str, npt.NDArray]):
    """The columns of a file; a missing column or one of another type is an error that names the file."""

    def __init__(self, path: Path, columns: dict[str, npt.NDArray]):
        with damage_reported(path, "has names that are not text"):  # lists
            words = {name: values.astype(str) for name, values in columns.items() if name in _WORDS}
        super().__init__(columns | words)
        self.path = path
        for name in self.keys() - _WORDS:
            if self[name].dtype.kind not in ("iu" if name == "timestamp_ns" else "fiub"):
                raise InputError(f"{path}: column {name} holds something else than numbers; download it again")

    def __missing__(self, name: str) -> npt.NDArray:
        raise InputError(f"{self.path} has no column {name}; download it again")


class Argoverse2Sequence(DrawnTruth, ListedSequence):
    """One log. Points are in the upper sensor's frame; poses are the vehicle's, carried over to it."""

    is_compensated = True
    """Sweeps are published motion-compensated."""

    def __init__(self, source: Path):
        """List the sweeps of log `source`."""
        files, stamps = stamped_files(source / _SCANS, ".feather")
        self._nanoseconds = np.array([int(file.stem) for file in files], np.int64)
        super().__init__(source, files, stamps)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        scan = self._to_scan(index, _read(self.paths[index]), 1e-9)
        T_scan_ego = inverse(self.T_vehicle_sensor)
        moved = replace(scan, points=transform(T_scan_ego, scan.points))
        if self._T_ego_sensors is None or scan.ring is None:
            return moved
        sensor = (scan.ring >= _LASERS).astype(np.uint8)
        return replace(moved, sensor=sensor, T_scan_sensor=T_scan_ego @ self._T_ego_sensors)

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor; None without poses."""
        if not is_there(self.source / _POSES):
            return None
        return sensor_poses(self._T_city_ego, self.T_vehicle_sensor)

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return (N,) uint32 labels of sweep `index`; None where the log has none for it.

        Where the log has per-point flow of its first sweep, its dynamic flags are the truth of that sweep and there is
        none of the others: the flags say what moves at that moment, boxes what moves at some time. Else the boxes are.
        """
        index = self._scan_number(index)
        if is_there(self.source / _FLOW):
            return self._from_flow() if index == 0 else None
        found = self._boxes_of(index)
        return super().truth(index) if found is not None and len(found[0]) else None

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return (N, 3) metres until the next sweep, as the annotated boxes say; None without."""
        index = self._scan_number(index)
        if not is_there(self.source / _BOXES) or index + 1 == len(self):
            return None
        now, later = self._drawn.of(self._nanoseconds[index]), self._drawn.of(self._nanoseconds[index + 1])
        points = transform(self.T_vehicle_sensor, self[index].points)
        boxes = later.boxes.transformed(inverse(self._T_city_ego[index]) @ self._T_city_ego[index + 1])
        motion = motion_with_boxes(points, now.track_at(points), (now.track, now.boxes), (later.track, boxes))
        return motion @ self.T_vehicle_sensor[:3, :3].astype(np.float32)

    def _boxes_of(self, index: int) -> tuple[DrawnBoxes, Pose] | None:
        is_drawn = is_there(self.source / _BOXES)
        return (self._drawn.of(self._nanoseconds[index]), self.T_vehicle_sensor) if is_drawn else None

    @property
    def T_vehicle_sensor(self) -> Pose:
        """(4, 4) of the upper sensor."""
        return self._calibrated(_SENSORS[0])

    # ------------------------------------------------------------------------------------------------------- tables

    def _calibrated(self, sensor: str) -> Pose:
        path, table = self.source / _CALIBRATION, self._calibration
        rows = np.flatnonzero(table["sensor_name"] == sensor)
        if len(rows) != 1:
            raise InputError(f"{path} must name the sensor {sensor!r} once; it names {', '.join(table['sensor_name'])}")
        return checked_mount(_transforms(table)[rows[0]], sensor, path)

    @cached_property
    def _calibration(self) -> Table:
        return _read(self.source / _CALIBRATION)

    @cached_property
    def _T_ego_sensors(self) -> Pose | None:
        """(2, 4, 4) of the sensors of lasers 0 to 31 and 32 to 63; None where the log has but one.

        The first sweep shows which half is whose: seen from its own sensor, a laser has one elevation.
        """
        if _SENSORS[1] not in self._calibration["sensor_name"]:
            return None
        T = np.stack([self._calibrated(sensor) for sensor in _SENSORS])
        table = _read(self.paths[0])
        points = np.column_stack([table[axis] for axis in "xyz"]).astype(np.float64)
        spread = np.zeros((2, 2))
        for k, of_sensor in enumerate(transform(inverse(T_ego_sensor), points) for T_ego_sensor in T):
            sine = of_sensor[:, 2] / np.maximum(np.linalg.norm(of_sensor, axis=1), 1e-6)
            for half in range(2):
                lasers = [sine[table["laser_number"] == half * _LASERS + laser] for laser in range(_LASERS)]
                spread[k, half] = np.median([np.abs(s - np.median(s)).mean() for s in lasers if len(s) > 20] or [0.0])
        return T[::-1] if np.trace(spread) > np.trace(spread[::-1]) else T

    @cached_property
    def _T_city_ego(self) -> Pose:
        return self._poses_at(self.stamps)

    def _poses_at(self, seconds: Array) -> Pose:
        table = _read(self.source / _POSES)
        return poses_at(seconds, 1e-9 * table["timestamp_ns"], _transforms(table), table.path)

    def _from_flow(self) -> npt.NDArray[np.uint32]:
        path = self.source / _FLOW
        is_dynamic = _read(path)["dynamic"]
        scan = self[0]
        if len(is_dynamic) != len(scan):
            raise InputError(f"{path} holds {len(is_dynamic)} rows, but sweep {scan.name} has {len(scan)} points")
        found = self._boxes_of(0)
        points = transform(self.T_vehicle_sensor, scan.points)
        instance = np.zeros(len(scan), np.int64) if found is None else found[0].track_at(points)
        return pack(np.where(is_dynamic, Label.MOVING, Label.STATIC), instance)

    @cached_property
    def _drawn(self) -> DrawnBoxes:
        """The boxes of all sweeps by their time, in the vehicle's frame."""
        table = _read(self.source / _BOXES)
        T_ego_box = _transforms(table)
        seconds = 1e-9 * table["timestamp_ns"]
        yaw = np.arctan2(T_ego_box[:, 1, 0], T_ego_box[:, 0, 0])
        size = np.column_stack([table[f"{side}_m"] for side in ("length", "width", "height")])
        boxes = checked_boxes(T_ego_box[:, :3, 3], size, yaw, table.path)
        return DrawnBoxes.judged(table["timestamp_ns"], table["track_uuid"], boxes, seconds, self._poses_at(seconds))


def _read(path: Path) -> Table:
    """Return the columns of one feather file, read where it may crash: damaged ones end pyarrow."""
    import_extra("pyarrow.feather", "arrow")
    return Table(path, read_apart("argoverse2", path))


def read_here(path: Path) -> Table:
    """Return what `_read` does, read in this process."""
    with arrow_reported(path, "a log needs it: download the log again", "cut short"):
        table = import_extra("pyarrow.feather", "arrow").read_table(path, memory_map=False)
        names = table.column_names  # which may be no text
    if len(set(names)) < len(names):
        raise InputError(f"{path} has two columns of one name; download it again")
    empty = [name for name in names if table[name].null_count]
    if empty:
        raise InputError(f"{path} has rows without {', '.join(empty)}; download it again")
    return Table(path, {name: table[name].to_numpy() for name in names})


def _transforms(table: Table) -> Pose:
    """Return the (R, 4, 4) transforms of a table's rows."""
    translation = np.column_stack([table[f"t{axis}_m"] for axis in "xyz"])
    with damage_reported(table.path, "holds transforms that are none"):
        return from_quaternions(translation, np.column_stack([table[f"q{part}"] for part in "xyzw"]), table.path)


FORMAT = Format(
    layout="Argoverse 2 Sensor log: sensors/lidar/*.feather, calibration/, city_SE3_egovehicle.feather",
    truth="dynamic flags of flow_labels.feather, else annotations.feather",
    find=lambda path: recordings_at(path, lambda log: (log / _SCANS).is_dir()),
    open=Argoverse2Sequence,
    needs="arrow",
)
