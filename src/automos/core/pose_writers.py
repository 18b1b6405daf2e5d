"""Write pose files: KITTI (12 numbers per line) and TUM (8 numbers per line)."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_text


def write_kitti(path: str | Path, poses: npt.ArrayLike) -> None:
    """Write `poses` (N, 4, 4) as KITTI's 12 numbers per line, atomically."""
    rows = np.asarray(poses, np.float64)[:, :3].reshape(-1, 12)
    lines = (" ".join(f"{value:.12e}" for value in row) for row in rows)
    write_text(Path(path), "".join(line + "\n" for line in lines))


def write_tum(path: str | Path, poses: npt.ArrayLike, stamps: npt.ArrayLike) -> None:
    """Write `poses` (N, 4, 4) and `stamps` (N,) seconds as TUM's lines `time x y z qx qy qz qw`, atomically."""
    from scipy.spatial.transform import Rotation

    T, times = np.asarray(poses, np.float64), np.asarray(stamps, np.float64)
    if times.shape != (len(T),):
        raise ValueError(f"stamps must be ({len(T)},), got shape {times.shape}")
    quaternions = Rotation.from_matrix(T[:, :3, :3]).as_quat(canonical=True) if len(T) else np.zeros((0, 4))
    lines = (
        f"{time:.9f} " + " ".join(f"{value:.12g}" for value in (*translation, *quaternion))
        for time, translation, quaternion in zip(times, T[:, :3, 3], quaternions, strict=True)
    )
    write_text(Path(path), "".join(line + "\n" for line in lines))
