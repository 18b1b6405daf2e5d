"""Checks of paths, objects and poses that callers pass: InputError with a sentence if they are something else."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np

from automos.arrays import Pose
from automos.errors import InputError
from automos.geometry import FARTHEST, inverse, is_rigid


def given_path(value: str | os.PathLike[str], what: str) -> Path:
    """Return `value` as a path; InputError if no file or folder can be named so, which `what` calls it."""
    try:
        path = Path(value)
        path.lstat()
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is not a path ({error}): give a text or a pathlib.Path, not {value!r:.80}") from None
    except OSError as error:  # what is not there yet may be made
        if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
            raise InputError(f"{what} {value!s:.80} cannot be used ({error.strerror}): give another path") from None
    return path


def require_kind(value: object, kind: Any, what: str, remedy: str) -> None:
    """Raise InputError if `value` is not of `kind`, a class; `remedy` says what to give as `what`."""
    if not isinstance(value, kind):
        raise InputError(f"{what} is {value!r:.80}, of type {type(value).__name__}: give {remedy}")


def checked_poses(poses: Pose, n: int) -> Pose:
    """Return (n, 4, 4) `poses` with exact rotations, in the frame of the first one.

    Raises
    ------
    InputError
        They are not one rigid transform per scan, or not on Earth.
    """
    poses = np.array(poses, np.float64)
    if poses.shape != (n, 4, 4):
        raise InputError(f"poses must be ({n}, 4, 4), one per scan, got shape {poses.shape}; give one pose per scan.")
    if not (is_valid := is_rigid(poses)).all():
        raise InputError(f"pose {np.argmin(is_valid)} is not a rigid transform; check the pose file's format.")
    if not (is_near := (np.abs(poses[:, :3, 3]) < FARTHEST).all(axis=1)).all():
        row = np.argmin(is_near)
        raise InputError(f"pose {row} is not on Earth (further than {FARTHEST:.0e} m from the origin); check its unit.")
    u, _, vt = np.linalg.svd(poses[:, :3, :3])  # pose files are rounded
    poses[:, :3, :3] = u @ vt
    return inverse(poses[0]) @ poses
