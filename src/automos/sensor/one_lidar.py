"""One of several LiDARs whose clouds are merged, as a recording of its own."""

from __future__ import annotations

import numpy as np

from automos.arrays import evenly_spread
from automos.geometry import Array
from automos.scan import Pose, Scan, Sequence

SAMPLES = 5
"""Scans in which the points of each LiDAR are counted."""


class OneLidar(Sequence):
    """The points of LiDAR `number` in each scan of `sequence`, in its own frame.

    What holds for the sweeps of one holds for all that are driven alike, each about its own axis, from wherever it
    begins. LiDARs that turn the other way, or not at all, need times in the file.
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
    """Return the recording and (N, 4, 4) poses of the LiDAR with most valid points; as given if scans name none."""
    mounts = sequence[0].T_scan_sensor
    if mounts is None:
        return sequence, poses
    few = [sequence[i] for i in evenly_spread(range(len(sequence)), SAMPLES)]
    found = [np.bincount(s.sensor[s.is_valid], minlength=len(mounts)) for s in few if s.sensor is not None]
    number = int(np.sum(found, axis=0).argmax())
    return OneLidar(sequence, number), None if poses is None else poses @ mounts[number]
