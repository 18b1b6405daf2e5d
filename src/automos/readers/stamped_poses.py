"""Poses that came with a recording, given on a clock of their own or as quaternions."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST, inverse, is_rigid
from automos.core.pose_files import MAX_SKEW, interpolate_poses, nearest_gap
from automos.core.scan import Pose

_HOLE = 1.0
"""Seconds from the nearest pose beyond which a scan's is not known: in that time a vehicle turns off."""
_NO_POSE = (
    "{} holds a pose that is none, is not on Earth, or whose rotation is scaled, sheared or mirrored; copy it again"
)


def from_quaternions(translation: npt.ArrayLike, xyzw: npt.ArrayLike, path: Path) -> Pose:
    """Return the (N, 4, 4) transforms of translations (N, 3), metres, and quaternions (N, 4), scalar last.

    Raises
    ------
    InputError
        Quaternions that are not of length one, or places that are not on Earth; `path` is what they came from.
    """
    from scipy.spatial.transform import Rotation

    translation = np.atleast_2d(np.asarray(translation, np.float64))
    xyzw = np.atleast_2d(np.asarray(xyzw, np.float64))
    if not ((np.abs(np.linalg.norm(xyzw, axis=1) - 1.0) <= MAX_SKEW).all() and (np.abs(translation) < FARTHEST).all()):
        raise InputError(_NO_POSE.format(path))
    T = np.tile(np.eye(4), (len(translation), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(xyzw).as_matrix()
    T[:, :3, 3] = translation
    return T


def rigid_transforms(T: npt.ArrayLike, path: Path) -> Pose:
    """Return transforms (N, 4, 4) with the nearest exact rotations; files round them.

    Raises
    ------
    InputError
        One is none, or not on Earth; `path` is what they came from.
    """
    T = np.array(T, np.float64)
    if not ((np.abs(T) < FARTHEST).all() and is_rigid(T, MAX_SKEW).all()):
        raise InputError(_NO_POSE.format(path))
    U, _, Vt = np.linalg.svd(T[:, :3, :3])
    T[:, :3, :3] = U @ Vt
    return T


def poses_at(
    stamps: npt.NDArray[np.float64], pose_stamps: npt.NDArray[np.float64], T_map_body: Pose, path: Path
) -> Pose:
    """Return (N, 4, 4) `T_map_body` at scan times `stamps` (N,), interpolated between `pose_stamps` (M,) seconds.

    Raises
    ------
    InputError
        The poses do not reach a scan: they begin later or end earlier by more than half the time between scans, or
        there are none for a while.
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
    apart = nearest_gap(stamps, times)
    if (apart > _HOLE).any():
        scan = int(np.argmax(apart > _HOLE))
        raise InputError(
            f"{path} has no pose for scan {scan} (time {stamps[scan]:.6f}): the nearest is {apart[scan]:.2f} s away; "
            "it is not whole: copy it again"
        )
    return interpolate_poses(times, T, stamps)


def truth_beside(folder: Path, name: str) -> Path | None:
    """Return the file of poses that VBR publishes with the recording `name` in `folder`: campus_train0_gt.txt."""
    return next(
        (path for path in sorted(folder.glob("*_gt.txt")) if name.startswith(path.name[: -len("_gt.txt")])), None
    )


def sensor_poses(T_map_body: Pose, T_body_sensor: npt.ArrayLike | None = None) -> Pose:
    """Return (N, 4, 4) T_world_sensor, the world being the first scan's sensor frame, from a body's poses in a map."""
    T = np.asarray(T_map_body, np.float64)
    if T_body_sensor is not None:
        T = T @ np.asarray(T_body_sensor, np.float64)
    return inverse(T[0]) @ T
