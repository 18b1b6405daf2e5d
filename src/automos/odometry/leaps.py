"""Leaps of speed no vehicle makes, and what went before them registered anew, backwards.

Amid traffic that pulls away beside it, between walls that fit anywhere along the street, a registration can stay with
the traffic: it stands, or creeps, until something makes it let go, and then leaps to the true speed. What follows is
right, and so is its map. From there the scans before are registered backwards in time.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_log
from automos.odometry.clock import Clock
from automos.odometry.kiss import KNOWN_MOTION, KissOdometry, Registered
from automos.odometry.motion import SweepTiming
from automos.odometry.register import START_SCANS
from automos.odometry.sweeps import usable_points
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

MAX_ACCELERATION = 4.0
"""m/s^2, a speed that rises faster was wrong before."""
LEAP_TIME = 0.5
"""Seconds for which it must."""


def find_leaps(steps: Pose, clock: Clock) -> list[int]:
    """Return the scans, in order, at which the speed has just risen faster than any vehicle's.

    steps : (N - 1, 4, 4) from each scan to the one before it.
    """
    speed = _speeds(steps, clock)
    m = max(round(LEAP_TIME / clock.period), 2)
    if len(speed) < 2 * m:
        return []
    mean = np.convolve(speed, np.full(m, 1.0 / m), "valid")
    rise = mean[m:] - mean[:-m]  # from the m steps before scan m, m + 1, ... to the m steps after it
    is_leap = np.concatenate([[False], rise > MAX_ACCELERATION * LEAP_TIME, [False]])
    ends = np.flatnonzero(is_leap[:-1] & ~is_leap[1:])  # of each run, its end
    return np.minimum(ends + 2 * m - 1, len(speed)).tolist()


def mend_leaps(
    sequence: Sequence,
    steps: Pose,
    timing: SweepTiming,
    clock: Clock,
    settings: OdometrySettings,
) -> Pose:
    """Return `steps` (N - 1, 4, 4), those before leaps found backwards where that makes the speed smoother.

    The same array where there was nothing to do.
    """
    until = len(steps) + 1
    while leaps := [leap for leap in find_leaps(steps, clock) if leap < until]:
        until = leaps[-1]
        backwards = _register_before(sequence, steps, until, timing, clock, settings)
        if _roughness(backwards, until, clock) < _roughness(steps, until, clock):
            steps = backwards
    return steps


def _roughness(steps: Pose, until: int, clock: Clock) -> float:
    """Return how unevenly the speed runs up to scan `until`: its squared changes over `leap_time`, summed."""
    m = max(round(LEAP_TIME / clock.period), 2)
    speed = _speeds(steps, clock)[: until + m]
    block = (len(speed) - 1 - np.arange(len(speed))) // m
    mean = np.bincount(block, speed) / np.bincount(block)
    return float((np.diff(mean) ** 2).sum())


def replay(
    sequence: Sequence, steps: Pose, timing: SweepTiming, clock: Clock, settings: OdometrySettings
) -> Iterator[Registered]:
    """Yield every scan as if it had been registered by `steps` (N - 1, 4, 4)."""
    twists = se3_log(steps) / clock.gaps[:, None]
    for i, scan in enumerate(sequence):
        during = timing.share * twists[max(i - 1, 0)]
        points, times = usable_points(scan, timing, during, settings)
        yield Registered(steps[i - 1] if i else np.eye(4), True, points, times, during)


def _register_before(
    sequence: Sequence,
    steps: Pose,
    leap: int,
    timing: SweepTiming,
    clock: Clock,
    settings: OdometrySettings,
) -> Pose:
    """Return `steps`, those before scan `leap` registered backwards as far as they are found to be wrong."""
    steps = steps.copy()
    last = min(leap + START_SCANS, len(steps))
    twist = se3_log(steps[last - 1]) / clock.gaps[last - 1]
    odometry = KissOdometry(settings, timing, twist, KNOWN_MOTION, True)
    odometry.register(sequence[last], 0.0)
    n_agreeing = 0
    for i in reversed(range(last)):
        T_before_this = inverse(odometry.register(sequence[i], clock.gaps[i]).T_last_this)
        if i >= leap:  # known already; these make the map
            continue
        change = np.linalg.norm(T_before_this[:3, 3] - steps[i, :3, 3]) / (clock.gaps[i] * clock.period)
        n_agreeing = n_agreeing + 1 if change < MAX_ACCELERATION * LEAP_TIME else 0
        if n_agreeing * clock.period > 2.0 * LEAP_TIME:
            break
        steps[i] = T_before_this
    return steps


def _speeds(steps: Pose, clock: Clock) -> Array:
    return np.linalg.norm(steps[:, :3, 3], axis=1) / (clock.gaps * clock.period)
