"""One of several LiDARs whose clouds are merged, as a recording of its own."""

from __future__ import annotations

import numpy as np

from automos.geometry import Array
from automos.scan import Pose, Scan, Sequence


class OneLidar(Sequence):
    """The points of LiDAR `number` in each scan of `sequence`, in its own frame.

    What holds for the sweeps of one holds for all of the same model: they are driven alike, each about its own axis.
    """

    def __init__(self, sequence: Sequence, number: int):
        """Take the recording of merged clouds."""
        self._sequence, self._number = sequence, number
        self.name, self.source = sequence.name, sequence.source

    def __len__(self) -> int:
        return len(self._sequence)

    def __getitem__(self, index: int) -> Scan:
        return self._sequence[index].of_sensor(self._number)[1]

    @property
    def names(self) -> list[str]:
        """As in the full recording."""
        return self._sequence.names

    @property
    def stamps(self) -> Array | None:
        """As in the full recording."""
        return self._sequence.stamps

    @property
    def is_compensated(self) -> bool | None:
        """As in the full recording."""
        return self._sequence.is_compensated


def with_one_lidar(sequence: Sequence, poses: Pose | None) -> tuple[Sequence, Pose | None]:
    """Return the recording and (N, 4, 4) poses of the LiDAR with most points; both as given if scans name no LiDARs."""
    scan = sequence[0]
    if scan.sensor is None or scan.T_scan_sensor is None:
        return sequence, poses
    number = int(np.bincount(scan.sensor, minlength=len(scan.T_scan_sensor)).argmax())
    return OneLidar(sequence, number), None if poses is None else poses @ scan.T_scan_sensor[number]
