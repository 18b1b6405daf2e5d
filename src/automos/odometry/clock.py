"""The recording's clock: stamps, the usual period between scans, and repeated scans."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.arrays import as_array
from automos.errors import InputError
from automos.odometry.trajectory import Trajectory
from automos.scan import LATEST, Scan, Sequence

USUAL_PERIOD = 0.1
"""Seconds between scans if the recording has no clock."""
MOST_UNEVEN = 1e-7
"""Least ratio of the shortest time between scans to the usual one: no clock resolves both."""
SHORTEST_PERIOD = 1e-3
"""Seconds: no sensor has a shorter period."""
STAMP_DIGITS = 9
"""Decimals of a stamp (nanoseconds), so that the same clock read from two formats is identical to the last bit."""
REPEAT_DELAY = 1e-3
"""Seconds by which a repeated scan is stamped later than the original, because stamps must increase."""


@dataclass(frozen=True, eq=False)
class Clock:
    """When the scans of a recording were taken.

    Attributes
    ----------
    stamps : (N,) float64, seconds.
    period : float, seconds, the usual time between scans.
    gaps : (N - 1,) float64, time between neighbouring scans over `period`: 1, unless a scan is clearly missing.
        Otherwise, stamps rounded to two decimals would cause speed errors of 10 %.
    has_stamps : bool, False if scans are only counted: then missing scans go unnoticed.
    """

    stamps: npt.NDArray[np.float64]
    period: float
    gaps: npt.NDArray[np.float64]
    has_stamps: bool = True

    def with_gaps(self, gaps: npt.NDArray[np.float64]) -> Clock:
        """Return the clock of the same scans if they are `gaps` (N - 1,) periods apart."""
        return Clock(
            self.stamps[0] + self.period * np.concatenate([[0.0], np.cumsum(gaps)]), self.period, gaps, self.has_stamps
        )


def read_clock(sequence: Sequence) -> Clock:
    """Return the clock of `sequence`; ten scans per second if it has none.

    Raises
    ------
    InputError
        The stamps are not one per scan, do not increase, or are not seconds.
    """
    n, given = len(sequence), sequence.stamps
    has_stamps = given is not None
    stamps = USUAL_PERIOD * np.arange(n, dtype=np.float64) if given is None else as_array(given, "f8", (n,), "stamps")
    if not (np.abs(stamps) < LATEST).all():
        odd = stamps[int(np.argmin(np.abs(stamps) < LATEST))]
        raise InputError(f"{sequence.name} has an invalid stamp of {odd:g} s: give stamps in seconds, or none")
    stamps = np.round(stamps, STAMP_DIGITS)
    if len(stamps) < 2:
        return Clock(stamps, USUAL_PERIOD, np.ones(0), has_stamps)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if not (steps > MOST_UNEVEN * usual).all() or usual < SHORTEST_PERIOD:
        least = int(np.argmin(steps))
        raise InputError(
            f"{sequence.name}: scan {least + 1} is {steps[least]:g} s after the previous scan (usual period: "
            f"{usual:g} s): stamps must be in seconds and increase; give valid stamps, or none"
        )
    gaps = np.where(steps > 1.5 * usual, steps / usual, 1.0)
    return Clock(stamps, float(steps[gaps == 1.0].mean()), gaps, has_stamps)


class DistinctScans(Sequence):
    """The scans of a recording without repeats of the previous scan."""

    def __init__(self, sequence: Sequence, is_repeat: npt.NDArray[np.bool_]):
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
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """Stamps of the distinct scans, seconds."""
        stamps = self._sequence.stamps
        return None if stamps is None else stamps[self._ids]

    @property
    def is_compensated(self) -> bool | None:
        """As in the full recording."""
        return self._sequence.is_compensated


def with_repeats(trajectory: Trajectory, is_repeat: npt.NDArray[np.bool_]) -> Trajectory:
    """Return the trajectory of all N scans from that of the distinct ones: a repeat has the pose of the original."""
    row = np.cumsum(~is_repeat) - 1
    nth = np.arange(len(row)) - np.flatnonzero(~is_repeat)[row]  # 0 for a distinct scan, 1 for its first repeat
    return replace(
        trajectory,
        T_world_sensor=trajectory.T_world_sensor[row],
        stamps=trajectory.stamps[row] + REPEAT_DELAY * nth,
        sweep_motion=trajectory.sweep_motion[row],
    )
