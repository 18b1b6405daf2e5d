"""The odometry, step by step: sweep timing, poses, refinement, loops, ground (paper III-A)."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.geometry import inverse, se3_log
from automos.odometry.kiss import Progress, register_scans
from automos.odometry.level import level_frame
from automos.odometry.motion import SweepTiming, compensate, sweep_times
from automos.odometry.timing import choose_timing
from automos.odometry.trajectory import Trajectory
from automos.scan import Points, Pose, Sequence
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

USUAL_GAP = 0.1
"""Seconds between scans where the recording has no clock."""


def estimate_trajectory(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None = None,
    progress: Progress | None = None,
) -> Trajectory:
    """Return the poses and the motion of the sensor at every scan of `sequence`.

    Parameters
    ----------
    sequence : at least one scan.
    settings : the odometry's.
    poses : (N, 4, 4) T_world_sensor known to the user; then nothing is registered, and only the motion during each
        sweep and the ground are found.
    progress : called with the number of scans done and their total.

    Raises
    ------
    InputError
        When the sequence is empty, or the poses are not one rigid transform per scan.
    """
    n = len(sequence)
    if n == 0:
        raise InputError(f"{sequence.name} holds no scans; give a folder with at least one.")
    stamps = sequence.stamps if sequence.stamps is not None else USUAL_GAP * np.arange(n)
    gaps = usual_gaps(stamps)
    warnings: list[str] = []
    timing = choose_timing(sequence, settings, poses, gaps)
    if poses is None:
        T_world_sensor, is_registered = register_scans(sequence, settings, timing, gaps, progress)
        if not is_registered.all():
            held = [sequence.names[i] for i in np.flatnonzero(~is_registered)]
            warnings.append(
                f"{len(held)} scans have too few points to register (first: {held[0]}); their poses are extrapolated."
            )
    else:
        T_world_sensor = _checked_poses(poses, n)
    motion = timing.share * step_twists(T_world_sensor, gaps)
    T_level_world, has_ground = _find_level(sequence, T_world_sensor, motion, timing, settings)
    if not has_ground:
        warnings.append("no ground found near the sensor; its own z axis is taken for up and its height for zero.")
    for warning in warnings:
        _log.warning("%s: %s", sequence.name, warning)
    diagnostics: dict[str, Any] = {"warnings": warnings}
    return Trajectory(T_world_sensor, stamps, motion, timing, T_level_world, diagnostics)


def usual_gaps(stamps: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return (N - 1,) time between neighbouring scans in units of the usual one, 1 unless a scan is clearly missing.

    Clocks written with two decimals would otherwise turn into 10 % of speed.
    """
    steps = np.diff(stamps)
    if len(steps) == 0:
        return steps
    relative = steps / np.median(steps)
    return np.where(relative > 1.5, relative, 1.0)


def step_twists(poses: Pose, gaps: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return (N, 6) twists per usual gap at each scan: the mean of the steps before and after it."""
    n = len(poses)
    if n < 2:
        return np.zeros((n, 6))
    steps = se3_log(inverse(poses[:-1]) @ poses[1:]) / gaps[:, None]
    before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    return 0.5 * (before + after)


def _checked_poses(poses: Pose, n: int) -> Pose:
    poses = np.asarray(poses, np.float64)
    if poses.shape != (n, 4, 4):
        raise InputError(f"poses must be ({n}, 4, 4), one per scan, got shape {poses.shape}; give one pose per scan.")
    R = poses[:, :3, :3]
    error = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    is_rigid = (error < 1e-2) & (np.linalg.det(R) > 0) & np.isfinite(poses).all(axis=(1, 2))
    if not is_rigid.all():
        raise InputError(
            f"pose {int(np.argmin(is_rigid))} is no rigid transform (rotation times its transpose is off by "
            f"{error[np.argmin(is_rigid)]:.3g}); check the pose file's format."
        )
    u, _, vt = np.linalg.svd(R)  # text files round; products of thousands of poses should not
    poses = poses.copy()
    poses[:, :3, :3] = u @ vt
    return inverse(poses[0]) @ poses


def _find_level(
    sequence: Sequence,
    poses: Pose,
    motion: npt.NDArray[np.float64],
    timing: SweepTiming,
    settings: OdometrySettings,
) -> tuple[Pose, bool]:
    ids = np.unique(np.linspace(0, len(sequence) - 1, settings.ground_scans).round().astype(int))
    clouds: list[Points] = []
    used: list[int] = []
    for i in ids:
        scan = sequence[int(i)]
        keep = scan.is_valid
        if keep.sum() < settings.min_points:
            continue
        points = scan.points[keep]
        times = sweep_times(scan, timing)
        clouds.append(points if times is None else compensate(points, times[keep], motion[i]))
        used.append(int(i))
    return level_frame(clouds, poses[used], settings)
