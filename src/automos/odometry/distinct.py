"""Recordings in which some scans are there twice: poses are found for the others, and given to both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.odometry.trajectory import Trajectory
from automos.scan import Scan, Sequence

TWICE = 1e-3
"""Seconds after a scan at which the same one once more is taken to be measured: stamps must increase."""


class DistinctScans(Sequence):
    """The scans of a recording that are not the one before them once more."""

    def __init__(self, sequence: Sequence, is_repeat: npt.NDArray[np.bool_]):
        """Take the recording and which of its scans (N,) to leave out."""
        self._sequence, self._ids = sequence, np.flatnonzero(~is_repeat)
        self.name, self.source = sequence.name, sequence.source

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> Scan:
        return self._sequence[int(self._ids[index])]

    @property
    def names(self) -> list[str]:
        """Those of the scans that are left."""
        names = self._sequence.names
        return [names[i] for i in self._ids]

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """Those of the scans that are left."""
        stamps = self._sequence.stamps
        return None if stamps is None else stamps[self._ids]

    @property
    def is_compensated(self) -> bool | None:
        """As the whole recording."""
        return self._sequence.is_compensated


def with_repeats(trajectory: Trajectory, is_repeat: npt.NDArray[np.bool_]) -> Trajectory:
    """Return the trajectory of all N scans, from that of the distinct ones: repeats are where the first one was."""
    row = np.cumsum(~is_repeat) - 1
    nth = np.arange(len(row)) - np.flatnonzero(~is_repeat)[row]  # 0 for a scan that is new, 1 for its first repeat
    return replace(
        trajectory,
        T_world_sensor=trajectory.T_world_sensor[row],
        stamps=trajectory.stamps[row] + TWICE * nth,
        sweep_motion=trajectory.sweep_motion[row],
    )
