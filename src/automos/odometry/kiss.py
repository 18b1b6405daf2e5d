"""Poses of every scan from the scans alone, with KISS-ICP (paper III-A; Vizzo et al., RA-L 2023).

Four things KISS-ICP leaves to its caller are done here. Scans reach it already compensated to mid-sweep, so its poses
are the sensor's at mid-sweep (its own compensation would move them to the sweep's end). The first scans are registered
twice, because nothing is known of the motion during the very first one. Every field of its configuration is written,
since it reads environment variables. And a scan too poor to register holds the motion instead of breaking the map.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.odometry.motion import SweepTiming, compensate, sweep_times
from automos.scan import Pose, Scan, Sequence
from automos.settings import OdometrySettings

Progress = Callable[[int, int], None]


def register_scans(
    sequence: Sequence,
    settings: OdometrySettings,
    timing: SweepTiming,
    gaps: npt.NDArray[np.float64],
    progress: Progress | None = None,
) -> tuple[Pose, npt.NDArray[np.bool_]]:
    """Return the poses of all scans and which of them were registered.

    Parameters
    ----------
    sequence : the scans.
    settings : the odometry's.
    timing : when in the sweep each point was measured.
    gaps : (N - 1,) time between neighbouring scans, in units of the usual one (1 where no scan is missing).
    progress : called with the number of scans done and their total.

    Returns
    -------
    T_world_sensor : (N, 4, 4) float64 at mid-sweep; world is the first scan's sensor frame.
    is_registered : (N,) bool, False where the pose is only extrapolated.
    """
    n = len(sequence)
    twist = _first_twist(sequence, settings, timing, gaps)
    odometry = _Odometry(settings, timing, twist)
    T_world_sensor = np.empty((n, 4, 4))
    is_registered = np.zeros(n, bool)
    for i in range(n):
        T_world_sensor[i], is_registered[i] = odometry.register(sequence[i], gaps[i - 1] if i else 0.0)
        if progress is not None:
            progress(i + 1, n)
    return inverse(T_world_sensor[0]) @ T_world_sensor, is_registered


def _first_twist(
    sequence: Sequence, settings: OdometrySettings, timing: SweepTiming, gaps: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return the (6,) motion per usual gap at the start: forwards over a few scans from rest, then backwards."""
    n = min(settings.start_scans, len(sequence))
    scans = [sequence[i] for i in range(n)]
    twist = np.zeros(6)
    forwards = _Odometry(settings, timing, twist)
    for i, scan in enumerate(scans):
        forwards.register(scan, gaps[i - 1] if i else 0.0)
    backwards = _Odometry(settings, timing, forwards.twist, reverse=True)
    for i in reversed(range(n)):
        backwards.register(scans[i], gaps[i] if i < n - 1 else 0.0)
    return backwards.twist


class _Odometry:
    """KISS-ICP with the motion it has seen, per usual gap, so that missing scans are bridged."""

    def __init__(
        self,
        settings: OdometrySettings,
        timing: SweepTiming,
        twist: npt.NDArray[np.float64],
        reverse: bool = False,
    ):
        self._icp = _make_kiss_icp(settings)
        self._timing = timing
        self._settings = settings
        self._sign = -1.0 if reverse else 1.0
        self.twist = twist  # forwards in time, whichever way the scans come

    def register(self, scan: Scan, gap: float) -> tuple[Pose, bool]:
        icp, sign = self._icp, self._sign
        last_pose = icp.last_pose.copy()
        predicted = last_pose @ se3_exp(sign * gap * self.twist)
        points = self._usable_points(scan)
        if len(points) < self._settings.min_points:
            icp.last_pose = predicted
            return predicted, False
        icp.last_delta = inverse(last_pose) @ predicted
        icp.register_frame(points, np.empty(0))
        pose = np.array(icp.last_pose)
        if not np.isfinite(pose).all():
            icp.last_pose = predicted
            return predicted, False
        if gap > 0.0:
            self.twist = sign / gap * se3_log(inverse(last_pose) @ pose)
        return pose, True

    def _usable_points(self, scan: Scan) -> npt.NDArray[np.float64]:
        """Return (M, 3) float64 valid points, compensated for the motion expected."""
        times = sweep_times(scan, self._timing)
        keep = scan.is_valid
        points = scan.points[keep]
        if times is not None:
            points = compensate(points, times[keep], self._timing.share * self.twist)
        return points.astype(np.float64)


def _make_kiss_icp(settings: OdometrySettings) -> Any:
    from kiss_icp.config import KISSConfig
    from kiss_icp.config.config import AdaptiveThresholdConfig, DataConfig, MappingConfig, RegistrationConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig(
        out_dir="",
        data=DataConfig(max_range=settings.max_range, min_range=settings.min_range, deskew=False),
        registration=RegistrationConfig(
            max_num_iterations=settings.max_iterations,
            convergence_criterion=settings.convergence,
            max_num_threads=1,  # more are not faster at these sizes, and one is deterministic
        ),
        mapping=MappingConfig(
            voxel_size=settings.voxel or settings.max_range / 100.0,
            max_points_per_voxel=settings.points_per_voxel,
        ),
        adaptive_threshold=AdaptiveThresholdConfig(
            fixed_threshold=None,
            initial_threshold=settings.initial_threshold,
            min_motion_th=settings.min_motion,
        ),
    )
    return KissICP(config)
