"""Poses of scans in a stream, as long as the assumed timing of sweeps does not change.

A scan is aligned with submaps of the last seconds, starting at its predicted pose. At the start, and where it does not
fit, it is registered to the last scans as in KISS-ICP, with a larger search range.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.odometry.kiss import START_SCANS, STEP_DIGITS
from automos.odometry.motion import MIN_POINTS, SweepTiming, usable_points
from automos.odometry.surfels import Surfels, surfels_of
from automos.online.near_map import NearMap
from automos.online.past_submaps import Come, Laid, PastSubmaps
from automos.scan import Pose, Scan
from automos.settings import OdometrySettings

FIRST_STEPS = np.concatenate([s * np.vstack([np.eye(6)[:2], -np.eye(6)[:2]]) for s in (0.4, 0.8, 1.2, 1.8, 2.5)])
"""Metres along the sensor's axes at which the second scan is tried: a registration begun at rest may stay there."""
DOUBTFUL = 0.7
"""Of the usual share of surfels that lie on what was seen before, below which a scan may lie elsewhere."""


@dataclass(frozen=True, eq=False)
class Came:
    """A scan on its way in: seconds, usual gaps since the one before (0 for the first), the usual gap in seconds."""

    scan: Scan
    stamp: float
    gap: float
    period: float


@dataclass(frozen=True, eq=False)
class Posed:
    """Where a scan was seen from.

    Attributes
    ----------
    T_world_sensor : (4, 4) float64
        The path's own world.
    timing : SweepTiming
        How the time of each point is known.
    sweep_motion : (6,) float64
        Motion during the sweep, for its compensation.
    """

    T_world_sensor: Pose
    timing: SweepTiming
    sweep_motion: npt.NDArray[np.float64]


class Path:
    """The motion of the sensor, scan by scan."""

    def __init__(
        self,
        settings: OdometrySettings,
        timing: SweepTiming,
        twist: npt.NDArray[np.float64] | None,
        T_world_first: Pose,
    ):
        """Take how sweeps are timed, the (6,) motion per usual gap at first if that is known, and the first pose."""
        self.timing, self.T_world_sensor = timing, T_world_first
        self.twist, self._doubt = np.zeros(6) if twist is None else twist, np.zeros(6)
        self._is_start_known = twist is not None
        self._settings = settings
        self._past, self._near = PastSubmaps(settings), NearMap(settings)
        self._shares = deque[float](maxlen=20)
        self._n = 0

    def follow(self, came: Came) -> Posed:
        """Return where the next scan was seen from."""
        share = self.timing.share
        points, times = usable_points(came.scan, self.timing, share * self.twist, self._settings)
        surfels = surfels_of(points, times)
        step = came.gap * self.twist
        if self._n == 0:
            step = np.zeros(6)
        elif len(points) >= MIN_POINTS:
            is_first = self._n == 1 and not self._is_start_known
            how = Come(came.stamp, self.T_world_sensor, came.gap, self.twist, self._doubt, came.period, share, is_first)
            laid = self._lay(surfels, how)
            step = np.round(se3_log(inverse(self.T_world_sensor) @ laid.T_world_sensor), STEP_DIGITS)
            self.twist, surfels = step / came.gap, laid.surfels
            self._doubt = laid.doubt / came.gap**2
        self.T_world_sensor = self.T_world_sensor @ se3_exp(step)
        self._past.add(came.stamp, self.T_world_sensor, surfels, came.period)
        self._near.add(self.T_world_sensor, surfels)
        self._n += 1
        return Posed(self.T_world_sensor, self.timing, share * self.twist)

    def _lay(self, surfels: Surfels, come: Come) -> Laid:
        """Return where a scan lies: usually near where it is expected; if not, it is looked for further around."""
        expected = come.T_world_last @ se3_exp(come.gap * come.twist)
        laid = self._past.lay([expected], surfels, come)
        usual = float(np.median(self._shares)) if self._shares else 1.0
        if (self._n < START_SCANS and not self._is_start_known) or laid.share <= DOUBTFUL * usual:
            guesses = [self._near.register(surfels, expected)]
            if come.is_first:
                guesses += [come.T_world_last @ se3_exp(step) for step in FIRST_STEPS]
            found = self._past.lay(guesses, surfels, come)
            laid = found if found.share >= laid.share else laid
        self._shares.append(laid.share)
        return laid
