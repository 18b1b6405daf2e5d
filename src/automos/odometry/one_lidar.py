"""One of several LiDARs whose clouds are merged, as a recording of its own."""

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.scan import Pose, Scan, Sequence
from automos.core.views import View
from automos.odometry.point_order import SAMPLES


class OneLidar(View):
    """The points of LiDAR `number` in each scan of `sequence`, in its own frame.

    What holds for the sweeps of one holds for all that are driven alike, each about its own axis, from wherever it
    begins. LiDARs that turn the other way, or not at all, need times in the file.
    """

    def __init__(self, sequence: Sequence, number: int):
        """Take the recording of merged clouds."""
        super().__init__(sequence)
        self._number = number

    def __getitem__(self, index: int) -> Scan:
        return super().__getitem__(index).of_sensor(self._number)[1]


def with_one_lidar(sequence: Sequence, poses: Pose) -> tuple[Sequence, Pose]:
    """Return the recording and (N, 4, 4) poses of the LiDAR with most valid points; as given if scans name none."""
    mounts = sequence[0].T_scan_sensor
    if mounts is None:
        return sequence, poses
    few = [sequence[i] for i in evenly_spread(range(len(sequence)), SAMPLES)]
    found = [np.bincount(s.sensor[s.is_valid], minlength=len(mounts)) for s in few if s.sensor is not None]
    number = int(np.sum(found, axis=0).argmax())
    return OneLidar(sequence, number), poses @ mounts[number]
