"""Poses of scans in a stream under one assumption on the timing of sweeps.

A scan is aligned with submaps of the last seconds, starting at its predicted pose. At the start, and if it does not
fit, it is registered to the last scans as in KISS-ICP, with a larger search range.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse, se3_exp, se3_log
from automos.core.scan import Pose, Scan
from automos.odometry.kiss import START_SCANS, STEP_DIGITS
from automos.odometry.motion import MIN_POINTS, usable_points
from automos.odometry.surfels import Surfels, surfels_of
from automos.odometry.sweep_timing import SweepTiming
from automos.online.near_map import NearMap
from automos.online.past_submaps import PastSubmaps, Prediction, ScanAlignment
from automos.settings import OdometrySettings

FIRST_STEPS = np.concatenate([s * np.vstack([np.eye(6)[:2], -np.eye(6)[:2]]) for s in (0.4, 0.8, 1.2, 1.8, 2.5)])
"""Metres along the sensor's axes, starts for the second scan: a registration that starts at rest may stay there."""
DOUBTFUL = 0.7
"""Factor on the usual share of matched surfels, below which an alignment may be wrong."""


@dataclass(frozen=True, eq=False)
class TimedScan:
    """A scan with its stamp (seconds), its gap to the previous one in periods (0 for the first), and the period (s)."""

    scan: Scan
    stamp: float
    gap: float
    period: float


@dataclass(frozen=True, eq=False)
class Posed:
    """The pose of a scan.

    Attributes
    ----------
    T_world_sensor : (4, 4) float64
        In the path's own world.
    timing : SweepTiming
        Source of the point times.
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
        """Take the timing of sweeps, the initial (6,) motion per usual gap or None if unknown, and the first pose."""
        self.timing, self.T_world_sensor = timing, T_world_first
        self.twist, self._variance = np.zeros(6) if twist is None else twist, np.zeros(6)
        self._is_start_known = twist is not None
        self._settings = settings
        self._past, self._near = PastSubmaps(settings), NearMap(settings)
        self._shares = deque[float](maxlen=20)
        self._n = 0

    def follow(self, timed: TimedScan) -> Posed:
        """Return the pose of the next scan."""
        share = self.timing.share
        points, times = usable_points(timed.scan, self.timing, share * self.twist, self._settings)
        surfels = surfels_of(points, times, self.timing.has_seam)
        step = timed.gap * self.twist
        if self._n == 0:
            step = np.zeros(6)
        elif len(points) >= MIN_POINTS:
            is_first = self._n == 1 and not self._is_start_known
            prediction = Prediction(
                timed.stamp, self.T_world_sensor, timed.gap, self.twist, self._variance, timed.period, share, is_first
            )
            aligned = self._align(surfels, prediction)
            step = np.round(se3_log(inverse(self.T_world_sensor) @ aligned.T_world_sensor), STEP_DIGITS)
            self.twist, surfels = step / timed.gap, aligned.surfels
            self._variance = aligned.variance / timed.gap**2
        self.T_world_sensor = self.T_world_sensor @ se3_exp(step)
        self._past.add(timed.stamp, self.T_world_sensor, surfels, timed.period)
        self._near.add(self.T_world_sensor, surfels)
        self._n += 1
        return Posed(self.T_world_sensor, self.timing, share * self.twist)

    def _align(self, surfels: Surfels, prediction: Prediction) -> ScanAlignment:
        """Return the alignment of a scan from its predicted pose or, if it does not fit, from a wider search."""
        expected = prediction.T_world_last @ se3_exp(prediction.gap * prediction.twist)
        aligned = self._past.align([expected], surfels, prediction)
        usual = float(np.median(self._shares)) if self._shares else 1.0
        if (self._n < START_SCANS and not self._is_start_known) or aligned.share <= DOUBTFUL * usual:
            guesses = [self._near.register(surfels, expected)]
            if prediction.is_first:
                guesses += [prediction.T_world_last @ se3_exp(step) for step in FIRST_STEPS]
            found = self._past.align(guesses, surfels, prediction)
            aligned = found if found.share >= aligned.share else aligned
        self._shares.append(aligned.share)
        return aligned
