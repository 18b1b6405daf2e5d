"""The recording's clock: stamps, the usual time between scans, and gaps where scans are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.scan import Sequence

USUAL_PERIOD = 0.1
"""Seconds between scans where the recording has no clock."""


@dataclass(frozen=True, eq=False)
class Clock:
    """When the scans of a recording were taken.

    Attributes
    ----------
    stamps : (N,) seconds.
    period : seconds, the usual time between scans.
    gaps : (N - 1,) time between neighbouring scans over `period`: 1, unless a scan is clearly missing. Clocks written
        with two decimals would otherwise turn into 10 % of speed.
    """

    stamps: npt.NDArray[np.float64]
    period: float
    gaps: npt.NDArray[np.float64]


def read_clock(sequence: Sequence) -> Clock:
    """Return the clock of `sequence`; ten scans a second where it has none."""
    stamps = sequence.stamps
    if stamps is None:
        stamps = USUAL_PERIOD * np.arange(len(sequence), dtype=np.float64)
    if len(stamps) < 2:
        return Clock(stamps, USUAL_PERIOD, np.ones(0))
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    gaps = np.where(steps > 1.5 * usual, steps / usual, 1.0)
    return Clock(stamps, float(steps[gaps == 1.0].mean()), gaps)
