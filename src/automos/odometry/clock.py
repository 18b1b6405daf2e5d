"""When the scans of a recording were taken: by their stamps, or else by their number."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from automos.core.arrays import as_array
from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.scan import LATEST, Sequence
from automos.settings import RecordingSettings

USUAL_PERIOD = 0.1
"""Seconds between scans where nobody says how many there are."""
GAP = 1.5
"""Times the usual step of the clock from which scans are missing."""
MOST_UNEVEN = 1e-7  # least ratio of the shortest time between scans to the usual one: no clock resolves both
SHORTEST_PERIOD = 1e-3  # seconds: no sensor has a shorter period
LONGEST_GAP = 10.0  # seconds that a gap counts at most: over a longer pause, the motion before it says nothing
STAMP_DIGITS = 9
"""Decimals of a stamp (nanoseconds), so that the same clock read from two formats is identical to the last bit."""


@dataclass(frozen=True, eq=False)
class Clock:
    """When the scans of a recording were taken.

    Gaps are 1 unless a scan is clearly missing: else, stamps rounded to two decimals would cause speed errors of 10 %.
    """

    stamps: Array  # (N,) seconds
    period: float  # seconds, the usual time between scans
    gaps: Array  # (N - 1,) time between neighbouring scans over `period`, that of a pause cut short
    has_stamps: bool  # False if scans are only counted: then `find_missing` estimates how many are missing

    def with_gaps(self, gaps: Array) -> Clock:
        """Return the clock of the same scans if they are `gaps` (N - 1,) periods apart."""
        return replace(self, stamps=self.stamps[0] + self.period * np.append(0.0, np.cumsum(gaps)), gaps=gaps)


class RunningClock:
    """When the scans of a stream were taken, known so far."""

    def __init__(self) -> None:
        self.stamp = 0.0  # seconds, of the last scan
        self._n, self._steps = 0, deque[float](maxlen=50)

    @property
    def period(self) -> float:
        """Seconds, the usual time between scans."""
        return float(np.median(self._steps)) if self._steps else USUAL_PERIOD

    def tick(self, stamp: float | None) -> tuple[float, float]:
        """Return the stamp of the next scan, and its gap to the last one in periods (0 for the first)."""
        before, gap, self._n = self.stamp, 1.0, self._n + 1
        if self._n == 1:
            self.stamp = stamp or 0.0
            return self.stamp, 0.0
        self.stamp = before + USUAL_PERIOD if stamp is None else stamp
        passed = round(self.stamp - before, STAMP_DIGITS)
        if passed > 0.0:  # otherwise out of order
            usual = self.period if self._steps else passed
            self._steps.append(passed)
            gap = min(passed, max(LONGEST_GAP, usual)) / usual if passed > GAP * usual else 1.0
        return self.stamp, gap


def rate_of(about: RecordingSettings, name: str) -> float | None:
    """Return the scans a second of the recording `name` where it has no times, None if nobody said."""
    return about.rates.get(name, about.rate)


def read_clock(sequence: Sequence, rate: float | None = None) -> Clock:
    """Return the clock of `sequence`; `rate` scans a second if it has none, ten if that is not known either.

    Raises
    ------
    InputError
        The stamps are not one per scan, do not increase, or are not seconds.
    """
    n, given, period = len(sequence), sequence.stamps, USUAL_PERIOD if rate is None else 1.0 / rate
    stamps = period * np.arange(n, dtype=np.float64) if given is None else as_array(given, "f8", (n,), "stamps")
    if not (np.abs(stamps) < LATEST).all():
        odd = stamps[int(np.argmin(np.abs(stamps) < LATEST))]
        raise InputError(f"{sequence.name} has an invalid stamp of {odd:g} s: give stamps in seconds, or none")
    stamps = np.round(stamps, STAMP_DIGITS)
    if len(stamps) < 2:
        return Clock(stamps, period, np.ones(0), given is not None)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if not (steps > MOST_UNEVEN * usual).all() or usual < SHORTEST_PERIOD:
        least = int(np.argmin(steps))
        raise InputError(
            f"{sequence.name}: scan {least + 1} is {steps[least]:g} s after the previous scan (usual period: "
            f"{usual:g} s): stamps must be in seconds and increase; give valid stamps, or none"
        )
    is_gap = steps > GAP * usual
    period = float(steps[~is_gap].mean())
    gaps = np.where(is_gap, np.minimum(steps, max(LONGEST_GAP, period)) / period, 1.0)
    return Clock(stamps, period, gaps, given is not None)
