"""The recording's clock: stamps, the usual time between scans, and gaps where scans are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.scan import Pose, Sequence

USUAL_PERIOD = 0.1
"""Seconds between scans where the recording has no clock."""
N_AROUND = 3
"""Steps on either side that tell how fast the sensor was."""
MOST_MISSING = 5
"""Neighbouring scans that may be missing at one place and still be counted."""
USUAL_ACCELERATION = 3.0
"""m/s^2, by which the speed changes from scan to scan."""
STEP_NOISE = 0.05
"""Metres, error of a registration from scan to scan."""
SELDOM = 10.0
"""Logarithm of how much likelier it is that no scan is missing at a place."""


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
    """Return the clock of `sequence`; ten scans a second where it has none."""
    stamps, has_stamps = sequence.stamps, sequence.stamps is not None
    if stamps is None:
        stamps = USUAL_PERIOD * np.arange(len(sequence), dtype=np.float64)
    if len(stamps) < 2:
        return Clock(stamps, USUAL_PERIOD, np.ones(0), has_stamps)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    gaps = np.where(steps > 1.5 * usual, steps / usual, 1.0)
    return Clock(stamps, float(steps[gaps == 1.0].mean()), gaps, has_stamps)


def find_missing(steps: Pose, gaps: npt.NDArray[np.float64], period: float) -> npt.NDArray[np.float64]:
    """Return (N - 1,) the gaps that the motion itself tells, where scans may be missing and no stamp says so.

    A step of twice the length amid even ones is a scan that is missing: no vehicle doubles its speed for a tenth of a
    second. How many are missing is the hypothesis under which the speed changes least, if the scans before and after
    agree on it.

    Parameters
    ----------
    steps : (N - 1, 4, 4) from each scan to the one before it, as registered.
    gaps : (N - 1,) taken where nothing else is clearly more likely.
    period : seconds between scans.
    """
    come, found = steps[:, :3, 3], gaps
    more = np.arange(2.0, 2.0 + MOST_MISSING)
    for _ in range(2):  # neighbours may have gaps of their own
        velocity, found = come / found[:, None], gaps.copy()
        for k in range(len(come)):
            sides = [velocity[max(k - N_AROUND, 0) : k], velocity[k + 1 : k + 1 + N_AROUND]]
            medians = [np.median(side, axis=0) for side in sides if len(side) == N_AROUND]
            if not medians:
                continue
            before, after = medians[0], medians[-1]
            usual = 0.5 * (before + after)
            if np.linalg.norm(after - before) > 0.2 * np.linalg.norm(usual):
                continue  # they disagree
            tried = np.append(gaps[k], more)
            deviation = np.hypot(STEP_NOISE, USUAL_ACCELERATION * (period * tried) ** 2)
            off = np.linalg.norm(come[k] - tried[:, None] * usual, axis=1) / deviation
            cost = 0.5 * off**2 + np.log(deviation) + SELDOM * (tried != gaps[k])
            best = int(np.argmin(cost))
            found[k] = tried[best] if off[best] < 3.0 else gaps[k]
    return found
