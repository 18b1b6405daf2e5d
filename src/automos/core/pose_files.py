"""Read pose files: KITTI (12 or 16 numbers per line) and TUM (8 numbers per line).

The result is `T_world_sensor`, with the world in the first scan's sensor frame unless the file's own is asked for.
Poses of another body (KITTI's are the left camera's) are transformed to the sensor with the calibration between the
two. A file that cannot be matched with the scans without doubt is an error: poses shifted by one scan look almost right
and ruin labels.
"""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST, inverse, make_transform, with_exact_rotations
from automos.core.reading import read_text
from automos.core.scan import Pose

logger = logging.getLogger(__name__)

MAX_SKEW = 0.01
"""How far R^T R may be from the identity, per entry, and a quaternion's length from one. Rounding to three digits stays
below; scaled, sheared or mirrored matrices and shifted columns do not."""


# ------------------------------------------------------------------------------------------------------- reading
def read_poses(
    path: str | Path,
    n_scans: int,
    stamps: npt.ArrayLike | None = None,
    T_camera_sensor: npt.ArrayLike | None = None,
    names: Sequence[str] | None = None,
    in_world: bool = False,
) -> Pose:
    """Return the poses of `n_scans` scans from a KITTI or TUM file, distinguished by their number of columns.

    Parameters
    ----------
    path : str or Path
        Text file with one pose per line. Blank lines and lines that start with # are skipped.
    n_scans : int
        Number of scans that the poses belong to.
    stamps : (n_scans,) float64, optional
        Times of the scans in seconds, in any order. TUM poses are interpolated at these if the two clocks agree.
    T_camera_sensor : (4, 4) float64, optional
        Pose of the sensor in the frame of the body whose poses the file holds (KITTI: the left camera).
    names : sequence of str, optional
        Name of each scan. In a KITTI file with more lines than scans (part of a drive), names that are numbers select
        the lines.
    in_world : bool
        Keep the file's own world, instead of that in which the first pose is the identity.

    Returns
    -------
    (n_scans, 4, 4) float64
        T_world_sensor in metres.

    Raises
    ------
    InputError
        The file is missing or not a pose file, a pose is not a rigid transform, or there are too few or too many.
    """
    path = Path(path)
    rows, line_numbers = _read_numbers(path)
    n_columns = rows.shape[1]
    if n_columns in (12, 16):
        T_world_body = _from_matrices(rows, line_numbers, path)
        T_world_body = T_world_body[lines_of_scans(len(rows), n_scans, names, path)]
    elif n_columns == 8:
        T_world_body = _at_scans(rows[:, 0], _from_quaternions(rows, line_numbers, path), n_scans, stamps, path)
    else:
        raise InputError(
            f"{path} has {n_columns} numbers a line, but poses have 12 or 16 (KITTI) or 8 (TUM); convert it"
        )
    if not (np.abs(T_world_body[:, :3, 3]) < FARTHEST).all():
        raise InputError(f"{path} has a pose that is not on Earth (further than {FARTHEST:.0e} m from its origin)")
    T = T_world_body if T_camera_sensor is None else T_world_body @ np.asarray(T_camera_sensor, np.float64)
    return T if in_world else inverse(T[0]) @ T


def read_calib(path: str | Path) -> Pose:
    """Return (4, 4) float64 `T_camera_sensor` from a KITTI calibration file, its line `Tr:` (or `Tr_velo_to_cam:`)."""
    path = Path(path)
    for number, line in enumerate(text_of(path).splitlines(), start=1):
        key, *values = line.replace(":", " ").split() or [""]
        if key in ("Tr", "Tr_velo_to_cam", "Tr_velo_cam"):
            row = _parse(values, number, path)
            if len(row) not in (12, 16):
                raise InputError(f"{path}, line {number}: {key} has {len(row)} numbers, but a transform has 12 or 16")
            return _from_matrices(row[None], np.array([number]), path)[0]
    raise InputError(f"{path} has no line 'Tr:' with the sensor's place in the camera frame; add it or remove the file")


def text_of(path: Path, if_missing: str = "does not exist; check the path") -> str:
    """Return the text of a file; InputError, with `if_missing` where it is absent."""
    try:
        return read_text(path)
    except FileNotFoundError:
        raise InputError(f"{path} {if_missing}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as text: {error}") from None


def _parse(words: Sequence[str], line_number: int, path: Path) -> npt.NDArray[np.float64]:
    try:
        return np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(f"{path}, line {line_number}: {error}; poses are numbers only") from None


def _read_numbers(path: Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return the file's (L, C) numbers and each row's line number."""
    rows: list[npt.NDArray[np.float64]] = []
    line_numbers: list[int] = []
    for number, line in enumerate(text_of(path).splitlines(), start=1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith("#"):
            continue
        row = _parse(words, number, path)
        if rows and len(row) != len(rows[0]):
            raise InputError(f"{path}, line {number}: {len(row)} numbers, but the lines before have {len(rows[0])}")
        rows.append(row)
        line_numbers.append(number)
    if not rows:
        raise InputError(f"{path} holds no poses")
    return np.array(rows), np.array(line_numbers)


def count_poses(path: str | Path) -> int:
    """Return how many poses a KITTI or TUM file holds."""
    return len(_read_numbers(Path(path))[0])


# ------------------------------------------------------------------------------------------------ numbers to poses
def _from_matrices(rows: npt.NDArray[np.float64], line_numbers: npt.NDArray[np.int64], path: Path) -> Pose:
    """Return (L, 4, 4) from (L, 12 or 16) row-major numbers, rotations made exactly orthonormal."""
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T.reshape(len(rows), 16)[:, : rows.shape[1]] = rows
    R = T[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # reported below
        skewness = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
        last_row = np.abs(T[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1)
        is_like_one = (skewness <= MAX_SKEW) & (np.linalg.det(R) > 0) & (last_row <= MAX_SKEW)
    is_rigid = np.isfinite(T).all(axis=(1, 2)) & is_like_one
    if not is_rigid.all():
        bad = int(np.argmin(is_rigid))
        raise InputError(
            f"{path}, line {line_numbers[bad]}: not a rigid transform (its rotation is off by {skewness[bad]:.3g}); "
            "poses are rotation and translation only, without scale or mirroring"
        )
    T[:, 3] = [0.0, 0.0, 0.0, 1.0]
    return with_exact_rotations(T)


def _from_quaternions(rows: npt.NDArray[np.float64], line_numbers: npt.NDArray[np.int64], path: Path) -> Pose:
    """Return (L, 4, 4) from (L, 8) rows of stamp, x, y, z, qx, qy, qz, qw."""
    from scipy.spatial.transform import Rotation

    length = np.linalg.norm(rows[:, 4:], axis=1)
    is_rigid = np.isfinite(rows).all(axis=1) & (np.abs(length - 1.0) <= MAX_SKEW)
    if not is_rigid.all():
        bad = int(np.argmin(is_rigid))
        raise InputError(
            f"{path}, line {line_numbers[bad]}: not a rigid transform (its quaternion has length {length[bad]:.3g}, "
            "not 1); a TUM line is: time x y z qx qy qz qw"
        )
    return make_transform(Rotation.from_quat(rows[:, 4:]).as_matrix(), rows[:, 1:4])


# ------------------------------------------------------------------------------------------------- poses to scans
def lines_of_scans(
    n_lines: int, n_scans: int, names: Sequence[str] | None, path: Path, what: str = "poses"
) -> npt.NDArray[np.int64]:
    """Return (n_scans,) the row of each scan in a file that says nothing of scans but its order.

    One line per scan is taken in order. Of more lines, those are taken that the scans' names, all numbers, count to.

    Raises
    ------
    InputError
        Fewer lines than scans, or more and no names that pick them.
    """
    if n_lines == n_scans:
        return np.arange(n_scans)
    if names is not None and n_lines > n_scans and all(name.isdecimal() and int(name) < n_lines for name in names):
        return np.array([int(name) for name in names])
    raise InputError(f"{path} holds {n_lines} {what} for {n_scans} scans; give one per scan, in the scans' order")


def _at_scans(
    pose_stamps: npt.NDArray[np.float64], T: Pose, n_scans: int, stamps: npt.ArrayLike | None, path: Path
) -> Pose:
    """Return (n_scans, 4, 4): `T` at the scans' stamps where the clocks agree, else one after the other."""
    if len(T) < n_scans:
        raise InputError(f"{path} holds {len(T)} poses for {n_scans} scans; give one per scan")
    if (np.diff(pose_stamps) <= 0).any():
        row = int(np.argmax(np.diff(pose_stamps) <= 0)) + 1
        raise InputError(
            f"{path}: pose {row + 1} (time {pose_stamps[row]:.6f}) is not after the one before; sort the file"
        )
    if stamps is not None:
        scan_stamps = np.asarray(stamps, np.float64)
        gap = nearest_gap(scan_stamps, pose_stamps)
        tolerance = 0.5 * np.median(np.diff(np.sort(scan_stamps))) if len(scan_stamps) > 1 else np.inf
        if (gap <= tolerance).all():
            return interpolate_poses(pose_stamps, T, scan_stamps)
        if len(T) != n_scans:
            worst = int(np.argmax(gap))
            raise InputError(
                f"{path} has no pose for scan {worst} (time {scan_stamps[worst]:.6f}), the nearest is {gap[worst]:.3f} "
                f"s away; give poses on the scans' clock, or one per scan ({len(T)} for {n_scans})"
            )
        logger.warning("%s runs on another clock than the scans: its poses are taken one per scan, in order", path)
    if len(T) > n_scans:
        raise InputError(f"{path} holds {len(T)} poses for {n_scans} scans without time stamps; give one pose per scan")
    return T


def nearest_gap(times: npt.NDArray[np.float64], pose_times: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return (len(times),) seconds to the nearest of sorted `pose_times`."""
    after = np.searchsorted(pose_times, times).clip(0, len(pose_times) - 1)
    before = (after - 1).clip(0)
    return np.minimum(np.abs(pose_times[after] - times), np.abs(pose_times[before] - times))


def interpolate_poses(pose_times: npt.NDArray[np.float64], T: Pose, times: npt.NDArray[np.float64]) -> Pose:
    """Return the poses at `times`, linear in translation and rotation between neighbours, constant beyond the ends.

    A pose stream of 100 Hz picked by nearest time would be up to 5 ms off, 10 cm at 20 m/s.
    """
    from scipy.spatial.transform import Rotation, Slerp

    if len(T) == 1:
        return np.repeat(T, len(times), axis=0)
    times = times.clip(pose_times[0], pose_times[-1])
    out = np.tile(np.eye(4), (len(times), 1, 1))
    out[:, :3, :3] = Slerp(pose_times, Rotation.from_matrix(T[:, :3, :3]))(times).as_matrix()
    out[:, :3, 3] = np.column_stack([np.interp(times, pose_times, T[:, axis, 3]) for axis in range(3)])
    return out
