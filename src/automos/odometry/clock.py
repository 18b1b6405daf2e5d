"""The recording's clock: stamps, the usual time between scans, and scans that are there twice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.arrays import as_array
from automos.errors import InputError
from automos.odometry.trajectory import Trajectory
from automos.scan import LATEST, Scan, Sequence

USUAL_PERIOD = 0.1
"""Seconds between scans where the recording has no clock."""
MOST_UNEVEN = 1e-7
"""Times the usual time between scans that the shortest is, at least: no clock counts both."""
SHORTEST_PERIOD = 1e-3
"""Seconds: no sensor scans as often."""
STAMP_DIGITS = 9
"""Decimals of a stamp: a nanosecond, so that one clock read from two formats is one clock to the last bit."""
TWICE = 1e-3
"""Seconds after a scan at which the same one once more is taken to be measured: stamps must increase."""


@dataclass(frozen=True, eq=False)
class Clock:
    """When the scans of a recording were taken.

    Attributes
    ----------
    stamps : (N,) seconds.
    period : seconds, the usual time between scans.
    gaps : (N - 1,) time between neighbouring scans over `period`: 1, unless a scan is clearly missing. Clocks written
        with two decimals would otherwise turn into 10 % of speed.
    has_stamps : False where scans are only counted: then some may be missing unnoticed.
    """

    stamps: npt.NDArray[np.float64]
    period: float
    gaps: npt.NDArray[np.float64]
    has_stamps: bool = True

    def with_gaps(self, gaps: npt.NDArray[np.float64]) -> Clock:
        """Return the clock of the same scans, had they been taken `gaps` (N - 1,) periods apart."""
        return Clock(
            self.stamps[0] + self.period * np.concatenate([[0.0], np.cumsum(gaps)]), self.period, gaps, self.has_stamps
        )


def read_clock(sequence: Sequence) -> Clock:
    """Return the clock of `sequence`; ten scans a second where it has none.

    Raises
    ------
    InputError
        Its stamps are not one for each scan, do not increase, or are no seconds.
    """
    n, given = len(sequence), sequence.stamps
    has_stamps = given is not None
    stamps = USUAL_PERIOD * np.arange(n, dtype=np.float64) if given is None else as_array(given, "f8", (n,), "stamps")
    if not (np.abs(stamps) < LATEST).all():
        odd = stamps[int(np.argmin(np.abs(stamps) < LATEST))]
        raise InputError(f"{sequence.name} has a scan at {odd:g} s, which is no time: give seconds, or no times")
    stamps = np.round(stamps, STAMP_DIGITS)
    if len(stamps) < 2:
        return Clock(stamps, USUAL_PERIOD, np.ones(0), has_stamps)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if not (steps > MOST_UNEVEN * usual).all() or usual < SHORTEST_PERIOD:
        least = int(np.argmin(steps))
        raise InputError(
            f"{sequence.name}: scan {least + 1} is {steps[least]:g} s after the one before it, usually there are "
            f"{usual:g} s between scans: times must increase, and are seconds; give such, or none"
        )
    gaps = np.where(steps > 1.5 * usual, steps / usual, 1.0)
    return Clock(stamps, float(steps[gaps == 1.0].mean()), gaps, has_stamps)


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
