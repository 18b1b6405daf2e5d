"""Errors of a trajectory against a reference: absolute (ATE), relative (RPE) and KITTI's drift per length.

All functions take poses `T_world_sensor` (N, 4, 4) of the same N scans in both trajectories. Relative errors need no
common world frame; for absolute errors the two trajectories are aligned first.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.table import Table

from automos.core.errors import InputError
from automos.core.geometry import Array, inverse, make_transform
from automos.core.pose_files import count_poses, read_calib, read_poses

KITTI_LENGTHS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Metres, the segments of KITTI's odometry benchmark; every tenth scan starts one of each."""


# ------------------------------------------------------------------------------------------------------ absolute
def align(estimate: npt.ArrayLike, reference: npt.ArrayLike) -> Array:
    """Return the (4, 4) T_reference_estimate that aligns the positions of `estimate` with those of `reference`.

    Umeyama's least squares without scale. On a straight line, the rotation about it is free, which moves no position.
    """
    p, q = _positions(estimate, reference)
    p_mean, q_mean = p.mean(axis=0), q.mean(axis=0)
    U, _, Vt = np.linalg.svd((q - q_mean).T @ (p - p_mean))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = U @ mirror @ Vt
    return make_transform(R, q_mean - R @ p_mean)


def absolute_errors(estimate: npt.ArrayLike, reference: npt.ArrayLike) -> Array:
    """Return (N,) metres between each position of the aligned `estimate` and the reference; their `rmse` is the ATE."""
    p, q = _positions(estimate, reference)
    T = align(estimate, reference)
    return np.linalg.norm(p @ T[:3, :3].T + T[:3, 3] - q, axis=1)


def rmse(errors: npt.ArrayLike) -> float:
    """Return the root of the mean square of `errors`, nan if there are none."""
    errors = np.asarray(errors, np.float64)
    return float(np.sqrt(np.mean(errors**2))) if errors.size else float("nan")


# ------------------------------------------------------------------------------------------------------ relative
@dataclass(frozen=True, eq=False)
class RelativeErrors:
    """Errors of the motion over K segments of the drive.

    Attributes
    ----------
    start, end : (K,) int64
        First and last scan of each segment.
    length : (K,) float64
        Metres driven on it, along the reference.
    translation : (K,) float64
        Metres.
    rotation_deg : (K,) float64
        Degrees.
    """

    start: npt.NDArray[np.int64]
    end: npt.NDArray[np.int64]
    length: Array
    translation: Array
    rotation_deg: Array

    def __len__(self) -> int:
        return len(self.start)

    @property
    def translation_percent(self) -> Array:
        """(K,) translation error in percent of the length driven; not finite where the vehicle stood."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return 100.0 * self.translation / self.length


def errors_over_distance(
    estimate: npt.ArrayLike, reference: npt.ArrayLike, distance: float, every: int = 1
) -> RelativeErrors:
    """Return the relative pose errors (RPE) over segments of `distance` metres that start at each `every`-th scan.

    A segment ends at the first scan more than `distance` along the reference from its start (as in KITTI's benchmark);
    starts too near the end of the drive have none.
    """
    estimate, reference = _same_scans(estimate, reference)
    travelled = path_length(reference)
    start = np.arange(0, len(reference), every)
    end = np.searchsorted(travelled, travelled[start] + distance, side="right")
    return _relative(estimate, reference, start[end < len(reference)], end[end < len(reference)], travelled)


def errors_over_time(
    estimate: npt.ArrayLike, reference: npt.ArrayLike, stamps: npt.ArrayLike, seconds: float, every: int = 1
) -> RelativeErrors:
    """Return the relative pose errors (RPE) over segments of `seconds` that start at each `every`-th scan.

    A segment ends at the scan nearest to `seconds` after its start; `stamps` (N,) are seconds, increasing.
    """
    estimate, reference = _same_scans(estimate, reference)
    times = np.asarray(stamps, np.float64)
    if times.shape != (len(reference),):
        raise ValueError(f"stamps must be ({len(reference)},), got shape {times.shape}")
    start = np.arange(0, len(reference), every)
    target = times[start] + seconds
    middles = 0.5 * (times[1:] + times[:-1])
    end = np.searchsorted(middles, target)
    # the last scan serves targets up to half a scan behind it, as every other does
    half = 0.5 * np.median(np.diff(times)) if len(times) > 1 else 0.0
    is_inside = (target <= times[-1] + half) & (end > start)
    return _relative(estimate, reference, start[is_inside], end[is_inside], path_length(reference))


def path_length(poses: npt.ArrayLike) -> Array:
    """Return (N,) metres driven from the first pose to each, summed over the steps between positions."""
    steps = np.linalg.norm(np.diff(np.asarray(poses, np.float64)[:, :3, 3], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _relative(
    estimate: Array, reference: Array, start: npt.NDArray[np.int64], end: npt.NDArray[np.int64], travelled: Array
) -> RelativeErrors:
    """Return the error inv(inv(Q_start) Q_end) inv(P_start) P_end of each segment (Q reference, P estimate)."""
    wanted = inverse(reference[start]) @ reference[end]
    got = inverse(estimate[start]) @ estimate[end]
    error = inverse(wanted) @ got
    return RelativeErrors(
        start,
        end,
        travelled[end] - travelled[start],
        np.linalg.norm(error[:, :3, 3], axis=1),
        np.degrees(rotation_angle(error[:, :3, :3])),
    )


def rotation_angle(R: npt.ArrayLike) -> Array:
    """Return (...,) radians in [0, pi] by which `R` (..., 3, 3) rotate; also exact for small angles."""
    R = np.asarray(R, np.float64)
    axis = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )  # twice the sine of the angle, along the axis
    return np.arctan2(np.linalg.norm(axis, axis=-1), np.trace(R, axis1=-2, axis2=-1) - 1.0)


# --------------------------------------------------------------------------------------------------------- KITTI
@dataclass(frozen=True)
class Drift:
    """KITTI's odometry errors: the mean over segments of all lengths.

    Attributes
    ----------
    t_err : float
        Percent of the length driven, nan if the drive is shorter than every length.
    r_err : float
        Degrees per metre.
    n_segments : int
        Segments the mean is over.
    """

    t_err: float
    r_err: float
    n_segments: int


def drift(
    estimate: npt.ArrayLike, reference: npt.ArrayLike, lengths: Sequence[float] = KITTI_LENGTHS, every: int = 10
) -> Drift:
    """Return KITTI's t_err and r_err over segments of `lengths` metres that start at each `every`-th scan.

    As in KITTI's devkit an error is divided by the segment's nominal length. Drives shorter than 100 m need shorter
    lengths, such as `lengths=(10,), every=1`.
    """
    found = [(length, errors_over_distance(estimate, reference, length, every)) for length in lengths]
    n_segments = sum(len(errors) for _, errors in found)
    if n_segments == 0:
        return Drift(float("nan"), float("nan"), 0)
    t_err = np.concatenate([errors.translation / length for length, errors in found])
    r_err = np.concatenate([errors.rotation_deg / length for length, errors in found])
    return Drift(100.0 * float(t_err.mean()), float(r_err.mean()), n_segments)


# ------------------------------------------------------------------------------------------------------- checks
def _same_scans(estimate: npt.ArrayLike, reference: npt.ArrayLike) -> tuple[Array, Array]:
    P, Q = np.asarray(estimate, np.float64), np.asarray(reference, np.float64)
    if P.ndim != 3 or P.shape[1:] != (4, 4) or P.shape != Q.shape or len(P) == 0:
        raise ValueError(f"estimate and reference must both be (N, 4, 4), N > 0, got shapes {P.shape} and {Q.shape}")
    return P, Q


def _positions(estimate: npt.ArrayLike, reference: npt.ArrayLike) -> tuple[Array, Array]:
    P, Q = _same_scans(estimate, reference)
    return P[:, :3, 3], Q[:, :3, 3]


SHORT_LENGTH = 10.0
"""Metres of the segments that drives too short for KITTI's are judged by."""


def compare_trajectories(estimate_file: Path, reference_file: Path, calib_file: Path | None = None) -> Table:
    """Return the errors of the poses in one file against those in another, one pose per scan in each.

    Parameters
    ----------
    calib_file : Path, optional
        Calib.txt with Tr:, where the reference holds the camera's poses and the estimate the sensor's.

    Raises
    ------
    InputError
        A file that cannot be read, or files of different lengths.
    """
    n, n_reference = count_poses(estimate_file), count_poses(reference_file)
    if n != n_reference:
        raise InputError(
            f"{estimate_file} holds {n} poses, {reference_file} {n_reference}: give files of the same scans"
        )
    T_camera_sensor = None if calib_file is None else read_calib(calib_file)
    return drift_table(read_poses(estimate_file, n), read_poses(reference_file, n, T_camera_sensor=T_camera_sensor))


def drift_table(estimate: npt.NDArray, reference: npt.NDArray) -> Table:
    """Return the errors of poses `estimate` (N, 4, 4) against `reference` (N, 4, 4), metres, as a table."""
    table = Table("error", "value", title=f"{len(estimate)} poses, {path_length(reference)[-1]:.0f} m driven")
    table.add_row("absolute (ATE), m", f"{rmse(absolute_errors(estimate, reference)):.3f}")
    relative = errors_over_distance(estimate, reference, SHORT_LENGTH, every=1)
    if len(relative):
        percent = 100.0 * float(np.mean(relative.translation / SHORT_LENGTH))
        table.add_row(f"relative over {SHORT_LENGTH:.0f} m (RPE), %", f"{percent:.2f}")
        turn = float(relative.rotation_deg.mean()) / SHORT_LENGTH
        table.add_row(f"relative over {SHORT_LENGTH:.0f} m (RPE), deg/m", f"{turn:.4f}")
    kitti = drift(estimate, reference)
    if kitti.n_segments:
        name = f"{KITTI_LENGTHS[0]:.0f} to {KITTI_LENGTHS[-1]:.0f} m"
        table.add_row(f"KITTI t_err over {name}, %", f"{kitti.t_err:.2f}")
        table.add_row(f"KITTI r_err over {name}, deg/m", f"{kitti.r_err:.4f}")
    return table
