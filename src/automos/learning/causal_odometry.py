"""Poses of scans as they come: KISS-ICP from the scans so far, never from later ones.

How sweeps are timed is a property of the sensor; where the scans do not say, it is found out once, from the first scans
in which the sensor moves. Until then points are taken as they come.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.array_sequence import ArraySequence
from automos.odometry.clock import USUAL_PERIOD, read_clock
from automos.odometry.kiss import KNOWN_MOTION, START_SCANS, UNKNOWN_MOTION, KissOdometry
from automos.odometry.motion import SweepTiming
from automos.odometry.moving_windows import MIN_BEND
from automos.odometry.timing import choose_timing
from automos.scan import Pose, Scan
from automos.settings import OdometrySettings


@dataclass(frozen=True, eq=False)
class Moved:
    """How the sensor moved up to a scan.

    Attributes
    ----------
    T_last_this : (4, 4) from this scan's sensor frame to the one before; identity for the first.
    stamp : seconds.
    timing : how the time of each point is known.
    sweep_motion : (6,) motion during the sweep, for its compensation.
    """

    T_last_this: Pose
    stamp: float
    timing: SweepTiming
    sweep_motion: npt.NDArray[np.float64]


class CausalOdometry:
    """The motion of the sensor, scan by scan."""

    def __init__(
        self,
        settings: OdometrySettings,
        timing_scans: int,
        timing: SweepTiming | None = None,
        is_compensated: bool | None = None,
    ):
        """Take how sweeps are timed, or None where it is to be found out after `timing_scans` scans."""
        if timing is None and (is_compensated or settings.time == "none"):
            timing = SweepTiming()
        self._settings, self._wanted, self._is_compensated = settings, timing_scans, is_compensated
        self._timing = timing
        self._kiss = KissOdometry(settings, timing or SweepTiming(), np.zeros(6), UNKNOWN_MOTION)
        self._n, self._stamp, self._steps = 0, 0.0, deque[float](maxlen=50)
        self._waiting: deque[tuple[Scan, float, float]] = deque(maxlen=timing_scans)  # scan, stamp, metres come

    def step(self, scan: Scan) -> Moved:
        """Return how the sensor moved from the last scan to this one."""
        gap = self._gap(scan)
        T_last_this = self._kiss.register(scan, gap).T_last_this
        self._n += 1
        if self._timing is None:
            self._waiting.append((scan, self._stamp, float(np.linalg.norm(T_last_this[:3, 3]))))
            if self._n % self._wanted == 0:
                self._find_timing()
        if self._n == START_SCANS:
            self._restart(scan)
        timing = self._timing or SweepTiming()
        return Moved(T_last_this, self._stamp, timing, timing.share * self._kiss.twist)

    def _gap(self, scan: Scan) -> float:
        """Return the usual gaps since the last scan, and move the clock on."""
        if self._n == 0:
            self._stamp = scan.stamp or 0.0
            return 0.0
        before = self._stamp
        self._stamp = before + USUAL_PERIOD if scan.stamp is None else scan.stamp
        passed = self._stamp - before
        usual = float(np.median(self._steps)) if self._steps else passed
        self._steps.append(passed)
        return passed / usual if passed > 1.5 * usual else 1.0

    def _find_timing(self) -> None:
        """Find out how sweeps are timed, if the sensor has moved enough to tell."""
        if np.mean([metres for _, _, metres in self._waiting]) < MIN_BEND:
            return
        stamps = [stamp for _, stamp, _ in self._waiting]
        scans = ArraySequence([scan for scan, _, _ in self._waiting], stamps, is_compensated=self._is_compensated)
        self._timing = choose_timing(scans, self._settings, None, read_clock(scans)).timing
        self._waiting.clear()
        self._restart(scans[len(scans) - 1])

    def _restart(self, scan: Scan) -> None:
        """Begin the local map anew with this scan, the motion now known and the points timed as they should be."""
        twist, settings = self._kiss.twist, self._settings
        self._kiss = KissOdometry(settings, self._timing or SweepTiming(), twist, KNOWN_MOTION)
        self._kiss.register(scan, 0.0)
