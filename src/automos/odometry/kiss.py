"""Poses of every scan from the scans alone, with KISS-ICP (paper III-A; Vizzo et al., RA-L 2023).

Two things KISS-ICP leaves to its caller are done here. Scans reach it already compensated to mid-sweep, so its poses
are the sensor's at mid-sweep (its own compensation would move them to the sweep's end). And a scan too poor to register
holds the motion instead of breaking the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.odometry.motion import SweepTiming
from automos.odometry.registration import Icp, LocalMap
from automos.odometry.sweeps import MIN_POINTS, usable_points
from automos.scan import Points, Pose, Scan
from automos.settings import OdometrySettings

STEP_DIGITS = 6
"""Decimals (m, rad) of a step: sums of another order show in the sixteenth digit, and reruns are identical."""
UNKNOWN_MOTION, KNOWN_MOTION = 2.0, 0.5
"""Metres, deviation expected at first: while the motion is unknown, and once it is known."""


@dataclass(frozen=True)
class Effort:
    """How long a registration goes on.

    Attributes
    ----------
    convergence : metres, it ends with a step shorter than this; KISS-ICP's own is 1e-4.
    start_convergence : metres, the same for the first scans, at most.
    max_iterations : at most.
    """

    convergence: float = 1e-3
    start_convergence: float = 1e-4
    max_iterations: int = 500


CAREFUL = Effort()
"""Of the recording itself."""


@dataclass(frozen=True, eq=False)
class Registered:
    """One scan and where it was put.

    Attributes
    ----------
    T_last_this : (4, 4) from this scan's sensor frame to the one before (identity for the first).
    is_registered : False where the motion is only held.
    points : (M, 3) float32 the usable points, compensated.
    times : (M,) float32 in [-0.5, 0.5], or None where unknown.
    twist : (6,) motion during the sweep they were compensated with.
    """

    T_last_this: Pose
    is_registered: bool
    points: Points
    times: npt.NDArray[np.float32] | None
    twist: npt.NDArray[np.float64]


class KissOdometry:
    """KISS-ICP with the motion it has seen, per usual gap, so that missing scans are bridged.

    `threshold` is the deviation from `twist` expected at first. KISS-ICP learns from great deviations only: with a good
    start it would look as far around as at first for ever, where rings match rings and pull to a standstill.
    """

    def __init__(
        self,
        settings: OdometrySettings,
        timing: SweepTiming,
        twist: npt.NDArray[np.float64],
        threshold: float,
        reverse: bool = False,
        effort: Effort = CAREFUL,
    ):
        local_map = LocalMap(map_voxel(settings), settings.points_per_voxel, settings.max_range)
        self._icp = Icp(local_map, threshold, settings.max_range, effort.convergence, effort.max_iterations)
        self._timing = timing
        self._settings = settings
        self._sign = -1.0 if reverse else 1.0
        self._before, self._pose = np.eye(4), np.eye(4)  # of the scan before the last, and of the last
        self.twist = twist  # forwards in time, whichever way the scans come

    def register(self, scan: Scan, gap: float) -> Registered:
        """Return `scan` registered to the ones before, `gap` usual gaps after the last (0 for the first)."""
        step = se3_exp(self._sign * gap * self.twist)
        during = self._timing.share * self.twist
        points, times = usable_points(scan, self._timing, during, self._settings)
        is_registered = len(points) >= MIN_POINTS
        if is_registered:
            T = self._icp.register(points, self._pose @ step)
            step = se3_exp(np.round(se3_log(inverse(self._pose) @ T), STEP_DIGITS))
            if gap > 0.0:
                self.twist = self._sign / gap * se3_log(step)
        self._before, self._pose = self._pose, self._pose @ step
        return Registered(step, is_registered, points, times, during)

    def correct(self, T_last_this: Pose, twist: npt.NDArray[np.float64]) -> None:
        """Take over where the last scan really was, and the motion (6,) per usual gap, from one who knows better."""
        self._pose = self._before @ T_last_this
        self.twist = twist


def map_voxel(settings: OdometrySettings) -> float:
    """Return metres, the edge of a voxel of the local map."""
    return settings.voxel or settings.max_range / 100.0
