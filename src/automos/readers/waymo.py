"""Waymo Open Dataset, version 2: a table (.parquet) per component and segment; a segment is a recording.

Segments are named as if they lay beside the components: `training/SEGMENT`. A scan is the two range images of the top
LiDAR, pixel by pixel, those without a return included; the vehicle's motion is taken out of it by the pose that comes
with each pixel, as Waymo does. It is in the vehicle's axes, but its origin is the LiDAR's, where the rays start.
The tables are read directly: Waymo's own library comes with its own TensorFlow.
"""

from collections.abc import Sequence as Sequence_
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import Array, inverse, make_transform
from automos.core.labels import Label
from automos.core.reading import damage_reported, is_there
from automos.core.scan import Ints, Pose, Scan
from automos.readers.box_truth import DrawnBoxes, DrawnTruth, checked_boxes
from automos.readers.foreign import ByThread
from automos.readers.formats import Format, digest_of_files, require_increasing
from automos.readers.listed import NamedSequence
from automos.readers.parquet import RowReader, read_columns
from automos.readers.range_image import place_pixels
from automos.readers.stamped_poses import checked_mount, rigid_transforms, sensor_poses

_TOP = 1
_TIME, _LASER, _OBJECT = "key.frame_timestamp_micros", "key.laser_name", "key.laser_object_id"
_RETURNS = tuple(f"[LiDARComponent].range_image_return{k}" for k in (1, 2))
_PIXEL_POSE = "[LiDARPoseComponent].range_image_return1"
_VEHICLE = "[VehiclePoseComponent].world_from_vehicle.transform"
_CALIBRATION = "[LiDARCalibrationComponent]"
_BOX = "[LiDARBoxComponent].box"


def find(path: Path) -> list[Path]:
    """Return the segments at `path`: itself, those of its split, or those of all splits in it, by name."""
    if _is_split(path.parent) and not path.exists():
        return [path] if is_there(_table(path, "lidar")) else []
    if _is_split(path):
        return [path / table.stem for table in sorted((path / "lidar").glob("*.parquet"))]
    if not path.is_dir():
        return []
    return [segment for split in sorted(path.iterdir()) if _is_split(split) for segment in find(split)]


def _is_split(path: Path) -> bool:
    return (path / "lidar").is_dir() and (path / "lidar_calibration").is_dir()


def _table(segment: Path, component: str) -> Path:
    return segment.parent / component / f"{segment.name}.parquet"


class WaymoSequence(DrawnTruth, NamedSequence):
    """One segment. Poses are the vehicle's, carried over to the origin of its top LiDAR."""

    is_compensated = True
    """The poses of the pixels are applied."""

    stamps: Array = np.zeros(0)

    def __init__(self, segment: Path):
        """Find the scans of a segment.

        Raises
        ------
        InputError
            A table that is absent, damaged or of another layout.
        """
        self.source, self.name = segment, segment.name
        self._threads = ByThread()
        self._micros, self._rows = self._times_and_rows("lidar", _LASER)
        if len(self._rows) == 0:
            raise InputError(f"{_table(segment, 'lidar')} holds no scans of the top LiDAR; download it again")
        self._names = [str(micros) for micros in self._micros]
        self.stamps = 1e-6 * self._micros.astype(np.float64)
        require_increasing(self.stamps, self._names, segment)
        self._pose_rows = self._find_rows("lidar_pose", _LASER)
        self._T_world_vehicle = self._read_poses()

    def __getitem__(self, index: int) -> Scan:
        images = self._range_images(index := self._scan_number(index))
        points = [self._to_points(index, image[..., 0]) for image in images]
        n_beams, width = images[0].shape[:2]
        return Scan(
            np.concatenate(points),
            intensity=np.concatenate([image[..., 1].ravel() for image in images]),
            ring=np.tile(np.repeat(np.arange(n_beams, dtype=np.uint16), width), len(images)),
            stamp=float(self.stamps[index]),
            name=self._names[index],
        )

    @property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) T_world_sensor from the vehicle's poses."""
        return sensor_poses(self._T_world_vehicle, self._T_vehicle_sensor)

    def _boxes_of(self, index: int) -> tuple[DrawnBoxes, Pose] | None:
        return None if self._drawn is None else (self._drawn.of(self._micros[index]), self._T_vehicle_sensor)

    def _judged(self, index: int, scan: Scan, labels: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
        """Return the labels without those of zones that were left out."""
        is_left_out = np.concatenate([image[..., 3].ravel() for image in self._range_images(index)]) > 0
        return np.where(is_left_out, np.uint32(Label.UNLABELED), labels)

    def fingerprint(self) -> str:
        """Return a text that changes when the tables do."""
        tables = [_table(self.source, component) for component in ("lidar", "lidar_pose", "lidar_calibration")]
        return f"{super().fingerprint()}:{digest_of_files([*tables, _table(self.source, 'vehicle_pose')])}"

    # -------------------------------------------------------------------------------------------------------- tables
    def _times_and_rows(self, component: str, *of_top: str) -> tuple[Ints, Ints]:
        """Return the times in a table and the rows they are in, of the top LiDAR where it names LiDARs."""
        path = _table(self.source, component)
        keys = read_columns(path, [_TIME, *of_top])
        if keys[_TIME].dtype.kind not in "iu":
            raise InputError(f"{path} has rows without a time; download it again")
        rows = np.flatnonzero(keys[_LASER] == _TOP) if of_top else np.arange(len(keys[_TIME]))
        return keys[_TIME][rows].astype(np.int64), rows

    def _find_rows(self, component: str, *of_top: str) -> list[int]:
        """Return the row of each scan in a table."""
        times, rows = self._times_and_rows(component, *of_top)
        row_at = dict(zip(times.tolist(), rows.tolist(), strict=True))
        try:
            return [row_at[micros] for micros in self._micros.tolist()]
        except KeyError as absent:
            path = _table(self.source, component)
            raise InputError(f"{path} has no row for the scan of {absent}; download it again") from None

    def _read_poses(self) -> Pose:
        path = _table(self.source, "vehicle_pose")
        with damage_reported(path):
            T = np.stack(read_columns(path, [_VEHICLE])[_VEHICLE].tolist()).reshape(-1, 4, 4)
            return rigid_transforms(T[self._find_rows("vehicle_pose")], path)

    def _reader(self, component: str, columns: Sequence_[str]) -> RowReader:
        """The opened table; one for each thread, as readers are not made to be shared."""
        readers = self._threads.__dict__.setdefault("readers", {})
        if component not in readers:
            wanted = [f"{column}.{part}" for column in columns for part in ("values", "shape")]
            readers[component] = RowReader(_table(self.source, component), wanted)
        return readers[component]

    def _range_images(self, index: int) -> list[npt.NDArray[np.float32]]:
        """Return the (H, W, 4) images of both returns: metres, intensity, elongation, in a zone not labelled."""
        row = self._reader("lidar", _RETURNS)[self._rows[index]]
        with damage_reported(_table(self.source, "lidar")):
            images = [_image(row, name, 4) for name in _RETURNS]
            if images[0].shape != images[1].shape:
                raise ValueError("two returns of different sizes")
        return images

    def _to_points(self, index: int, distance: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the (H * W, 3) points of ranges (H, W), at the origin where there was no return."""
        row = self._reader("lidar_pose", [_PIXEL_POSE])[self._pose_rows[index]]
        elevation, T_vehicle_laser = self._calibration
        with damage_reported(_table(self.source, "lidar_pose")):
            pixel_pose = _image(row, _PIXEL_POSE, 6)
            if pixel_pose.shape[:2] != distance.shape or len(elevation) != len(distance):
                raise ValueError("poses of another number of pixels, or angles of another number of rows")
        T_sensor_world = inverse(self._T_world_vehicle[index] @ self._T_vehicle_sensor)
        return place_pixels(distance, pixel_pose, elevation, T_vehicle_laser, T_sensor_world)

    @cached_property
    def _calibration(self) -> tuple[Array, Pose]:
        """(H,) elevations of the range images' rows in radians, and (4, 4) T_vehicle_laser."""
        path = _table(self.source, "lidar_calibration")
        names = [f"{_CALIBRATION}.extrinsic.transform", f"{_CALIBRATION}.beam_inclination.values"]
        columns = read_columns(path, [_LASER, *names])
        rows = np.flatnonzero(columns[_LASER] == _TOP)
        if len(rows) != 1:
            raise InputError(f"{path} must have the top LiDAR once, but has it {len(rows)} times; download it again")
        with damage_reported(path):
            T, elevation = (np.asarray(columns[name][rows[0]], np.float64) for name in names)
            if elevation.ndim != 1 or not np.isfinite(elevation).all():
                raise ValueError("angles of rows that are none")
            return elevation[::-1].copy(), checked_mount(T.reshape(4, 4), "the top LiDAR", path)

    @property
    def _T_vehicle_sensor(self) -> Pose:
        return make_transform(t=self._calibration[1][:3, 3])

    @cached_property
    def _drawn(self) -> DrawnBoxes | None:
        """The boxes of all scans by their time, in the vehicle's frame; None without."""
        path = _table(self.source, "lidar_box")
        if not is_there(path):
            return None
        parts = [f"{_BOX}.heading", *(f"{_BOX}.{of}.{axis}" for of in ("center", "size") for axis in "xyz")]
        table = read_columns(path, [_TIME, _OBJECT, *parts])
        with damage_reported(path):
            yaw, *sides = (table[part].astype(np.float64) for part in parts)
            if table[_TIME].dtype.kind not in "iu":
                raise ValueError("times that are not whole numbers")
            objects = table[_OBJECT].astype(str)
        boxes = checked_boxes(np.column_stack(sides[:3]), np.column_stack(sides[3:]), yaw, path)
        scan = np.searchsorted(self._micros, table[_TIME]).clip(max=len(self) - 1)
        return DrawnBoxes.judged(table[_TIME], objects, boxes, 1e-6 * table[_TIME], self._T_world_vehicle[scan])


def _image(row: dict[str, npt.NDArray], name: str, n_channels: int) -> npt.NDArray[np.float32]:
    """Return an image (H, W, n_channels) from its flat values and its shape."""
    shape = row[f"{name}.shape"].tolist()
    if len(shape) != 3 or min(shape) < 0 or shape[2] != n_channels:
        raise ValueError(f"an image of shape {shape}")
    return row[f"{name}.values"].astype(np.float32).reshape(shape)


FORMAT = Format(
    layout="Waymo Open Dataset v2: {lidar,lidar_pose,lidar_calibration,vehicle_pose,lidar_box}/SEGMENT.parquet",
    truth="lidar_box",
    find=find,
    open=WaymoSequence,
    needs="arrow",
)
