"""Apollo SouthBay: pcds/N.pcd and poses/gt_poses.txt with the number, time and pose of each.

Its labelled version is in KITTI's layout and read as that.
"""

from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.reading import is_there
from automos.core.scan import Pose
from automos.readers.folder import FolderSequence
from automos.readers.formats import Format, recordings_at
from automos.readers.records import read_table
from automos.readers.stamped_poses import from_quaternions, sensor_poses

_SCANS, _POSES = "pcds", Path("poses") / "gt_poses.txt"


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, or those in it by name."""
    return recordings_at(path, _is_recording)


def _is_recording(path: Path) -> bool:
    return (path / _SCANS).is_dir() and is_there(path / _POSES)


class ApolloSequence(FolderSequence):
    """One run; scans are matched to poses by their number."""

    def __init__(self, source: Path):
        """List the scans of the run in folder `source`."""
        super().__init__(source, "pcd", _SCANS)

    def _read_times(self, stamps_from_names: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64] | None:
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
        if self._stamps is not None:
            off = np.abs(rows[:, 1] - self._stamps)
            if (off > 1.0).any():
                first = int(np.argmax(off > 1.0))
                raise InputError(
                    f"{self.source / _POSES} has the pose of {self._names[first]}.pcd at {rows[first, 1]:.3f} s, but "
                    f"its points are of {self._stamps[first]:.3f} s; it belongs to another run"
                )
        return sensor_poses(from_quaternions(rows[:, 2:5], rows[:, 5:], self.source / _POSES))

    def _rows(self) -> npt.NDArray[np.float64]:
        """Return (len, 9) of each scan: number, seconds, x, y, z, qx, qy, qz, qw."""
        table = read_table(self.source / _POSES, 9, "poses")
        row_of = {int(number): row for row, number in enumerate(table[:, 0])}
        missing = next((name for name in self._names if not name.isdecimal() or int(name) not in row_of), None)
        if missing is not None:
            raise InputError(f"{self.source / _POSES} has no pose for scan {missing}.pcd; it belongs to another run")
        return table[[row_of[int(name)] for name in self._names]]


FORMAT = Format(layout="Apollo SouthBay: pcds/*.pcd, poses/gt_poses.txt", find=find, open=ApolloSequence)
