"""When the scans of a recording were taken: by their stamps, or else by their number."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from automos.core.arrays import as_array
from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.scan import LATEST, Sequence

USUAL_PERIOD = 0.1  # seconds between scans if the recording has no clock
MOST_UNEVEN = 1e-7  # least ratio of the shortest time between scans to the usual one: no clock resolves both
SHORTEST_PERIOD = 1e-3  # seconds: no sensor has a shorter period
STAMP_DIGITS = 9
"""Decimals of a stamp (nanoseconds), so that the same clock read from two formats is identical to the last bit."""


@dataclass(frozen=True, eq=False)
class Clock:
    """When the scans of a recording were taken.

    Gaps are 1 unless a scan is clearly missing: else, stamps rounded to two decimals would cause speed errors of 10 %.
    """

    stamps: Array  # (N,) seconds
    period: float  # seconds, the usual time between scans
    gaps: Array  # (N - 1,) time between neighbouring scans over `period`
    has_stamps: bool  # False if scans are only counted: then `find_missing` estimates how many are missing

    def with_gaps(self, gaps: Array) -> Clock:
        """Return the clock of the same scans if they are `gaps` (N - 1,) periods apart."""
        return replace(self, stamps=self.stamps[0] + self.period * np.append(0.0, np.cumsum(gaps)), gaps=gaps)


def read_clock(sequence: Sequence) -> Clock:
    """Return the clock of `sequence`; ten scans per second if it has none.

    Raises
    ------
    InputError
        The stamps are not one per scan, do not increase, or are not seconds.
    """
    n, given = len(sequence), sequence.stamps
    stamps = USUAL_PERIOD * np.arange(n, dtype=np.float64) if given is None else as_array(given, "f8", (n,), "stamps")
    if not (np.abs(stamps) < LATEST).all():
        odd = stamps[int(np.argmin(np.abs(stamps) < LATEST))]
        raise InputError(f"{sequence.name} has an invalid stamp of {odd:g} s: give stamps in seconds, or none")
    stamps = np.round(stamps, STAMP_DIGITS)
    if len(stamps) < 2:
        return Clock(stamps, USUAL_PERIOD, np.ones(0), given is not None)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if not (steps > MOST_UNEVEN * usual).all() or usual < SHORTEST_PERIOD:
        least = int(np.argmin(steps))
        raise InputError(
            f"{sequence.name}: scan {least + 1} is {steps[least]:g} s after the previous scan (usual period: "
            f"{usual:g} s): stamps must be in seconds and increase; give valid stamps, or none"
        )
    is_gap = steps > 1.5 * usual
    period = float(steps[~is_gap].mean())
    return Clock(stamps, period, np.where(is_gap, steps / period, 1.0), given is not None)
