"""MulRan: Ouster/<nanoseconds>.bin of an OS1-64, global_pose.csv of the vehicle.

Clouds are 64 x 1024, column after column, so that a point's place in the file gives its beam and time. A few files are
incomplete; those have neither.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from automos.core.geometry import make_transform
from automos.core.reading import is_there
from automos.core.scan import Pose, Scan
from automos.readers.columns import Columns, to_scan
from automos.readers.formats import Format, recordings_at
from automos.readers.listed import ListedSequence, stamped_files
from automos.readers.records import read_records, read_table
from automos.readers.stamped_poses import poses_at, rigid_transforms, sensor_poses

_SCANS, _POSES = "Ouster", "global_pose.csv"
_BEAMS, _COLUMNS, _PERIOD = 64, 1024, 0.1
_POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, or those in it by name."""
    return recordings_at(path, _is_recording)


def _is_recording(path: Path) -> bool:
    # HeLiPR has a folder of the same name, but below LiDAR/ and with poses elsewhere.
    return (path / _SCANS).is_dir() and is_there(path / _POSES)


class MulranSequence(ListedSequence):
    """One drive, in the Ouster's frame."""

    def __init__(self, source: Path):
        """List the scans of the drive in folder `source`."""
        files, stamps = stamped_files(source / _SCANS, ".bin")
        super().__init__(source, files, stamps=stamps)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        columns: Columns = dict(read_records(self._files[index], _POINT))
        if len(columns["x"]) == _BEAMS * _COLUMNS:
            place = np.arange(_BEAMS * _COLUMNS)
            columns["ring"] = place % _BEAMS
            columns["time"] = (place // _BEAMS) * (_PERIOD / _COLUMNS)
        assert self.stamps is not None
        return to_scan(columns, self._files[index], self._names[index], float(self.stamps[index]), 1.0)

    @cached_property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) T_world_sensor from the vehicle's poses."""
        from scipy.spatial.transform import Rotation

        path = self.source / _POSES
        table = read_table(path, 13, "poses", ",")
        T_map_base = np.tile(np.eye(4), (len(table), 1, 1))
        T_map_base[:, :3] = table[:, 1:].reshape(-1, 3, 4)
        turn = Rotation.from_euler("xyz", [0.0001, 0.0003, 179.6654], degrees=True).as_matrix()
        T_base_sensor = make_transform(turn, [1.7042, -0.021, 1.8047])  # published with the data set
        assert self.stamps is not None
        T = poses_at(self.stamps, 1e-9 * table[:, 0], rigid_transforms(T_map_base, path), path)
        return sensor_poses(T, T_base_sensor)


FORMAT = Format(layout="MulRan: Ouster/*.bin, global_pose.csv", truth="", find=find, open=MulranSequence)
