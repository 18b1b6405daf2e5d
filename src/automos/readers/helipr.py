"""HeLiPR: LiDAR/{Aeva,Avia,Ouster,Velodyne}/<nanoseconds>.bin of four sensors, LiDAR_GT/*_gt.txt of each.

Each sensor is a recording of its own. Points are its driver's packed structs; every one has its time.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from automos.core.reading import is_there
from automos.core.scan import Pose, Scan
from automos.readers.columns import to_scan
from automos.readers.formats import Format
from automos.readers.listed import ListedSequence, stamped_files
from automos.readers.records import read_records, read_table
from automos.readers.stamped_poses import from_quaternions, poses_at, sensor_poses

_XYZ = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
_AEVA = [*_XYZ, ("_reflectivity", "<f4"), ("_velocity", "<f4"), ("t", "<i4"), ("line", "u1")]
_POINTS = {
    "Aeva": np.dtype([*_AEVA, ("intensity", "<f4")]),
    "Avia": np.dtype([*_XYZ, ("reflectivity", "u1"), ("_tag", "u1"), ("line", "u1"), ("t", "<u4")]),
    "Ouster": np.dtype(
        [*_XYZ, ("intensity", "<f4"), ("t", "<u4"), ("_reflectivity", "<u2"), ("ring", "<u2"), ("_ambient", "<u2")]
    ),
    "Velodyne": np.dtype([*_XYZ, ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")]),
}
_AEVA_WITHOUT_INTENSITY = np.dtype(_AEVA)
_LAST_WITHOUT_INTENSITY = 1691936557946849179
"""Nanoseconds: up to this scan the Aeva was recorded without intensity."""


def find(path: Path) -> list[Path]:
    """Return the sensors' folders at `path`: itself, or those of a drive, by name."""
    if path.name in _POINTS and path.parent.name == "LiDAR" and path.is_dir():
        return [path]
    return [path / "LiDAR" / name for name in _POINTS if (path / "LiDAR" / name).is_dir()]


class HeliprSequence(ListedSequence):
    """One sensor of one drive."""

    def __init__(self, source: Path):
        """List the scans in the sensor's folder `source`."""
        files, stamps = stamped_files(source, ".bin")
        super().__init__(source, files, stamps=stamps, name=f"{source.resolve().parent.parent.name}_{source.name}")

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        path = self._files[index]
        dtype = _POINTS[self.source.name]
        if self.source.name == "Aeva" and int(path.stem) <= _LAST_WITHOUT_INTENSITY:
            dtype = _AEVA_WITHOUT_INTENSITY
        assert self.stamps is not None
        unit = 1.0 if "time" in (dtype.names or ()) else 1e-9
        return to_scan(read_records(path, dtype), path, self._names[index], float(self.stamps[index]), unit)

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor of this sensor; None without its poses."""
        path = self.source.parent.parent / "LiDAR_GT" / f"{self.source.name}_gt.txt"
        if not is_there(path):
            return None
        table = read_table(path, 8, "poses")
        T = from_quaternions(table[:, 1:4], table[:, 4:], path)
        assert self.stamps is not None
        return sensor_poses(poses_at(self.stamps, 1e-9 * table[:, 0], T, path))


FORMAT = Format(
    layout="HeLiPR: LiDAR/{Aeva,Avia,Ouster,Velodyne}/*.bin, LiDAR_GT/; each sensor is a recording",
    truth="",
    find=find,
    open=HeliprSequence,
)
