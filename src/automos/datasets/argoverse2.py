"""Argoverse 2 Sensor logs: sensors/lidar/*.feather, calibration, ego poses, boxes, and per-point flow where it is.

The files hold both 32-beam sensors' points in the vehicle's frame, carried to one time. The points are brought back to
the frame of the upper sensor, from which they were seen: rays start there, not on the rear axle.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.datasets.box_truth import DrawnBoxes, judge_boxes, motion_with_boxes, paint_boxes
from automos.datasets.columns import to_scan
from automos.datasets.formats import Format, import_extra, recordings_at
from automos.datasets.listed import ListedSequence, stamped_files
from automos.datasets.stamped_poses import from_quaternions, poses_at, sensor_poses
from automos.errors import InputError
from automos.geometry import Boxes, inverse, points_in_boxes, transform
from automos.labels import Label, pack
from automos.scan import Pose, Scan

_SCANS = Path("sensors") / "lidar"
_CALIBRATION = Path("calibration") / "egovehicle_SE3_sensor.feather"
_POSES = "city_SE3_egovehicle.feather"
_BOXES = "annotations.feather"
_FLOW = "flow_labels.feather"
_SENSOR = "up_lidar"

Table = dict[str, npt.NDArray]


def find(path: Path) -> list[Path]:
    """Return the logs at `path`: itself, or those in it by name."""
    return recordings_at(path, lambda p: (p / _SCANS).is_dir())


class Argoverse2Sequence(ListedSequence):
    """One log. Points are in the upper sensor's frame; poses are the vehicle's, carried over to it."""

    def __init__(self, source: Path):
        """List the sweeps of log `source`."""
        files, stamps = stamped_files(source / _SCANS, ".feather")
        self._nanoseconds = np.array([int(file.stem) for file in files], np.int64)
        super().__init__(source, files, stamps=stamps)

    def __getitem__(self, index: int) -> Scan:
        index = range(len(self))[index]
        path = self._files[index]
        scan = to_scan(_read(path), path, self._names[index], 1e-9 * self._nanoseconds[index], 1e-9)
        points = transform(inverse(self._T_ego_sensor), scan.points)
        return Scan(points, scan.intensity, scan.time, scan.ring, scan.stamp, scan.name)

    @property
    def is_compensated(self) -> bool:
        """Sweeps are published motion-compensated."""
        return True

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor; None without poses."""
        if not (self.source / _POSES).exists():
            return None
        return sensor_poses(self._T_city_ego, self._T_ego_sensor)

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return (N,) uint32 labels of sweep `index`; None where the log has none for it.

        Where the log has per-point flow of its first sweep, its dynamic flags are the truth of that sweep and there is
        none of the others: the flags say what moves at that moment, boxes what moves at some time. Else the boxes are.
        """
        index = range(len(self))[index]
        if (self.source / _FLOW).exists():
            return self._from_flow() if index == 0 else None
        return self._from_boxes(index) if (self.source / _BOXES).exists() else None

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return (N, 3) metres until the next sweep, as the annotated boxes say; None without."""
        index = range(len(self))[index]
        if not (self.source / _BOXES).exists() or index + 1 == len(self):
            return None
        now, later = self._drawn.of(self._nanoseconds[index]), self._drawn.of(self._nanoseconds[index + 1])
        T_now_later = inverse(self._T_city_ego[index]) @ self._T_city_ego[index + 1]
        T_ego_sensor = self._T_ego_sensor
        points = transform(T_ego_sensor, self[index].points)
        owner = points_in_boxes(points, now.boxes)
        instance = np.where(owner >= 0, now.track[owner], 0) if len(now) else np.zeros(len(points), np.int64)
        boxes = later.boxes.transformed(T_now_later)
        motion = motion_with_boxes(points, instance, (now.track, now.boxes), (later.track, boxes))
        return motion @ T_ego_sensor[:3, :3].astype(np.float32)

    @property
    def T_vehicle_sensor(self) -> Pose:
        """(4, 4) of the upper sensor."""
        return self._T_ego_sensor

    # ------------------------------------------------------------------------------------------------------- tables
    @cached_property
    def _T_ego_sensor(self) -> Pose:
        path = self.source / _CALIBRATION
        table = _read(path)
        rows = np.flatnonzero(table["sensor_name"] == _SENSOR)
        if len(rows) != 1:
            raise InputError(
                f"{path} must name the sensor {_SENSOR!r} once; it names {', '.join(table['sensor_name'])}"
            )
        return _transforms(table)[rows[0]]

    @cached_property
    def _T_city_ego(self) -> Pose:
        path = self.source / _POSES
        table = _read(path)
        assert self.stamps is not None
        return poses_at(self.stamps, 1e-9 * table["timestamp_ns"], _transforms(table), path)

    def _from_flow(self) -> npt.NDArray[np.uint32]:
        path = self.source / _FLOW
        is_dynamic = _read(path)["dynamic"]
        scan = self[0]
        if len(is_dynamic) != len(scan):
            raise InputError(f"{path} holds {len(is_dynamic)} rows, but sweep {scan.name} has {len(scan)} points")
        label = np.where(is_dynamic, Label.MOVING, Label.STATIC)
        instance = np.zeros(len(scan), np.int64)
        if (self.source / _BOXES).exists():
            drawn = self._drawn.of(self._nanoseconds[0])
            owner = points_in_boxes(transform(self._T_ego_sensor, scan.points), drawn.boxes)
            instance[owner >= 0] = drawn.track[owner[owner >= 0]]
        return pack(label, instance)

    def _from_boxes(self, index: int) -> npt.NDArray[np.uint32] | None:
        drawn = self._drawn.of(self._nanoseconds[index])
        return paint_boxes(self[index], self._T_ego_sensor, drawn) if len(drawn) else None

    @cached_property
    def _drawn(self) -> DrawnBoxes:
        """The boxes of all sweeps by their time, in the vehicle's frame."""
        table = _read(self.source / _BOXES)
        T_ego_box = _transforms(table)
        seconds = 1e-9 * table["timestamp_ns"]
        poses = _read(self.source / _POSES)
        T_city_ego = poses_at(seconds, 1e-9 * poses["timestamp_ns"], _transforms(poses), self.source / _POSES)
        _, track = np.unique(table["track_uuid"], return_inverse=True)
        yaw = np.arctan2(T_ego_box[:, 1, 0], T_ego_box[:, 0, 0])
        size = np.column_stack([table[f"{side}_m"] for side in ("length", "width", "height")])
        return DrawnBoxes(
            table["timestamp_ns"],
            track.astype(np.int64) + 1,
            Boxes(T_ego_box[:, :3, 3], size, yaw, np.ones(len(yaw))),
            judge_boxes(track, seconds, (T_city_ego @ T_ego_box)[:, :3, 3]),
        )


def _read(path: Path) -> Table:
    """Return the columns of one feather file."""
    feather, arrow = import_extra("pyarrow.feather", "arrow"), import_extra("pyarrow", "arrow")
    try:
        table = feather.read_table(path, memory_map=False)
    except FileNotFoundError:
        raise InputError(f"{path} is missing; a log needs it: download the log again") from None
    except (OSError, arrow.ArrowInvalid) as error:
        raise InputError(f"{path} is damaged or cut short ({error}); download it again") from None
    return {name: table[name].to_numpy() for name in table.column_names}


def _transforms(table: Table) -> Pose:
    """Return the (R, 4, 4) transforms of a table's rows."""
    translation = np.column_stack([table[f"t{axis}_m"] for axis in "xyz"])
    return from_quaternions(translation, np.column_stack([table[f"q{part}"] for part in "xyzw"]))


FORMAT = Format(
    layout="Argoverse 2 Sensor log: sensors/lidar/*.feather, calibration/, city_SE3_egovehicle.feather",
    truth="dynamic flags of flow_labels.feather, else annotations.feather",
    find=find,
    open=Argoverse2Sequence,
    needs="arrow",
)
