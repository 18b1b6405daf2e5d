"""Recordings in which scans are stored more than once: the repeats get the pose of the original."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from automos.geometry import Array
from automos.scan import Mask, Scan, Sequence
from automos.trajectory import Trajectory

REPEAT_DELAY = 1e-3
"""Seconds by which a repeated scan is stamped later than the one before, because stamps must increase; less if many
would reach beyond the next distinct one."""


class DistinctScans(Sequence):
    """The scans of a recording without repeats of the previous scan."""

    def __init__(self, sequence: Sequence, is_repeat: Mask):
        """Take the recording and a mask (N,) of the scans to leave out."""
        self._sequence, self._ids = sequence, np.flatnonzero(~is_repeat)
        self.name, self.source = sequence.name, sequence.source

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> Scan:
        return self._sequence[int(self._ids[index])]

    @property
    def names(self) -> list[str]:
        """Names of the distinct scans."""
        names = self._sequence.names
        return [names[i] for i in self._ids]

    @property
    def stamps(self) -> Array | None:
        """Stamps of the distinct scans, seconds."""
        stamps = self._sequence.stamps
        return None if stamps is None else stamps[self._ids]

    @property
    def is_compensated(self) -> bool | None:
        """As in the full recording."""
        return self._sequence.is_compensated


def with_repeats(trajectory: Trajectory, is_repeat: Mask) -> Trajectory:
    """Return the trajectory of all N scans from that of the distinct ones: a repeat has the pose of the original."""
    row = np.cumsum(~is_repeat) - 1
    nth = np.arange(len(row)) - np.flatnonzero(~is_repeat)[row]  # 0 for a distinct scan, 1 for its first repeat
    gaps = np.diff(trajectory.stamps, append=trajectory.stamps[-1] + 1.0)
    delay = np.minimum(REPEAT_DELAY, 0.5 * gaps / np.bincount(row))
    return replace(
        trajectory,
        T_world_sensor=trajectory.T_world_sensor[row],
        stamps=trajectory.stamps[row] + delay[row] * nth,
        sweep_motion=trajectory.sweep_motion[row],
    )
