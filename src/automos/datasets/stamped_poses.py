"""Poses that came with a recording, given on a clock of their own or as quaternions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.geometry import inverse
from automos.pose_files import FARTHEST, interpolate_poses
from automos.scan import Pose


def from_quaternions(translation: npt.ArrayLike, xyzw: npt.ArrayLike) -> Pose:
    """Return the (N, 4, 4) transforms of translations (N, 3), metres, and quaternions (N, 4), scalar last."""
    from scipy.spatial.transform import Rotation

    translation = np.atleast_2d(np.asarray(translation, np.float64))
    _require_on_earth(translation)
    _require_on_earth(np.asarray(xyzw, np.float64))
    T = np.tile(np.eye(4), (len(translation), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(np.atleast_2d(np.asarray(xyzw, np.float64))).as_matrix()
    T[:, :3, 3] = translation
    return T


def orthonormal(T: npt.ArrayLike) -> Pose:
    """Return transforms (N, 4, 4) with the nearest exact rotations; files round them."""
    T = np.array(T, np.float64)
    _require_on_earth(T)  # LAPACK does not come back from what is infinite
    U, _, Vt = np.linalg.svd(T[:, :3, :3])
    T[:, :3, :3] = U @ Vt
    return T


def _require_on_earth(numbers: npt.NDArray[np.float64]) -> None:
    if not (np.abs(numbers) < FARTHEST).all():
        raise InputError("the recording's poses hold numbers that are none, or are not on Earth; copy them again")


def poses_at(
    stamps: npt.NDArray[np.float64], pose_stamps: npt.NDArray[np.float64], T_map_body: Pose, path: Path
) -> Pose:
    """Return (N, 4, 4) `T_map_body` at scan times `stamps` (N,), interpolated between `pose_stamps` (M,) seconds.

    Raises
    ------
    InputError
        The poses do not reach a scan: they begin later or end earlier by more than half the time between scans.
    """
    if len(pose_stamps) == 0:
        raise InputError(f"{path} holds no poses")
    order = np.argsort(pose_stamps, kind="stable")
    order = order[np.r_[True, np.diff(pose_stamps[order]) > 0]]
    times, T = pose_stamps[order], T_map_body[order]
    slack = 0.5 * float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.05
    is_outside = (stamps < times[0] - slack) | (stamps > times[-1] + slack)
    if is_outside.any():
        scan = int(np.argmax(is_outside))
        raise InputError(
            f"{path} has no pose for scan {scan} (time {stamps[scan]:.6f}): its poses are from {times[0]:.6f} to "
            f"{times[-1]:.6f}; it belongs to another recording or is not whole"
        )
    return interpolate_poses(times, T, stamps)


def sensor_poses(T_map_body: Pose, T_body_sensor: npt.ArrayLike | None = None) -> Pose:
    """Return (N, 4, 4) T_world_sensor, the world being the first scan's sensor frame, from a body's poses in a map."""
    T = np.asarray(T_map_body, np.float64)
    if T_body_sensor is not None:
        T = T @ np.asarray(T_body_sensor, np.float64)
    return inverse(T[0]) @ T
