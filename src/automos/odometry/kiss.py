"""Poses of every scan from the scans alone, with KISS-ICP (paper III-A; Vizzo et al., RA-L 2023).

Three things KISS-ICP leaves to its caller are done here. Scans reach it already compensated to mid-sweep, so its poses
are the sensor's at mid-sweep (its own compensation would move them to the sweep's end). Every field of its
configuration is written, since it reads environment variables. And a scan too poor to register holds the motion instead
of breaking the map.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.odometry.motion import SweepTiming
from automos.odometry.sweeps import usable_points
from automos.scan import Points, Pose, Scan
from automos.settings import OdometrySettings

STEP_DIGITS = 6
"""Decimals (m, rad) of a step. Threads add in any order, which shows in the sixteenth digit: reruns are identical."""
MAX_THREADS = 4
"""More have too few points each to be any faster."""


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
    ):
        self._icp = _make_kiss_icp(settings, threshold)
        self._timing = timing
        self._settings = settings
        self._sign = -1.0 if reverse else 1.0
        self.twist = twist  # forwards in time, whichever way the scans come

    def register(self, scan: Scan, gap: float) -> Registered:
        """Return `scan` registered to the ones before, `gap` usual gaps after the last (0 for the first)."""
        icp, sign = self._icp, self._sign
        last_pose = np.array(icp.last_pose)
        predicted = last_pose @ se3_exp(sign * gap * self.twist)
        during = self._timing.share * self.twist
        points, times = usable_points(scan, self._timing, during, self._settings)
        is_registered = len(points) >= self._settings.min_points
        if is_registered:
            icp.last_delta = inverse(last_pose) @ predicted
            icp.register_frame(points.astype(np.float64), np.empty(0))
            is_registered = bool(np.isfinite(icp.last_pose).all())
            if is_registered:
                step = se3_log(inverse(last_pose) @ icp.last_pose)
                icp.last_pose = last_pose @ se3_exp(np.round(step, STEP_DIGITS))
        if not is_registered:
            icp.last_pose = predicted
        step = inverse(last_pose) @ icp.last_pose
        if is_registered and gap > 0.0:
            self.twist = sign / gap * se3_log(step)
        return Registered(step, is_registered, points, times, during)

    def add_to_map(self, points: Points, T_world_sensor: Pose) -> None:
        """Add `points` (M, 3), sensor frame, of a scan whose pose is known to the local map."""
        self._icp.local_map.update(points.astype(np.float64), T_world_sensor)

    def register_at(self, scan: Scan, expected: Pose) -> Pose:
        """Return the (4, 4) T_world_sensor of a scan that is about at `expected`; that where it cannot be told."""
        self._icp.last_pose = expected
        return expected @ self.register(scan, 0.0).T_last_this


def map_voxel(settings: OdometrySettings) -> float:
    """Return metres, the edge of a voxel of the local map."""
    return settings.voxel or settings.max_range / 100.0


def _make_kiss_icp(settings: OdometrySettings, threshold: float) -> Any:
    from kiss_icp.config import KISSConfig
    from kiss_icp.config.config import AdaptiveThresholdConfig, DataConfig, MappingConfig, RegistrationConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig(
        out_dir="",
        data=DataConfig(max_range=settings.max_range, min_range=settings.min_range, deskew=False),
        registration=RegistrationConfig(
            max_num_iterations=settings.max_iterations,
            convergence_criterion=settings.convergence,
            # The first that is asked for holds for the process: KISS-ICP limits its threads once.
            max_num_threads=min(settings.threads or os.cpu_count() or 1, MAX_THREADS),
        ),
        mapping=MappingConfig(
            voxel_size=map_voxel(settings),
            max_points_per_voxel=settings.points_per_voxel,
        ),
        adaptive_threshold=AdaptiveThresholdConfig(
            fixed_threshold=None,
            initial_threshold=threshold,
            min_motion_th=settings.min_motion,
        ),
    )
    return KissICP(config)
