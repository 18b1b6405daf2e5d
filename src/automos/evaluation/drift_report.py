"""Errors of estimated poses against reference poses, as a table."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.table import Table

from automos.core.errors import InputError
from automos.core.pose_files import count_poses, read_calib, read_poses
from automos.evaluation.trajectory import KITTI_LENGTHS, absolute_errors, drift, errors_over_distance, path_length, rmse

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
