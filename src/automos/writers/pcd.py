"""Point Cloud Library files, binary, one per scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path
from automos.core.scan import Pose
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import packed_rows, point_columns


def write(run: RunFiles, out: Path) -> None:
    """Write every scan as `out / <name>.pcd` with the columns of `point_columns`."""
    out.mkdir(parents=True, exist_ok=True)
    for index in run.each("writing .pcd"):
        write_pcd(out / f"{run.names[index]}.pcd", point_columns(run, index))


def write_pcd(path: Path, columns: dict[str, npt.NDArray], T_world_sensor: Pose | None = None) -> None:
    """Write `columns`, each (N,), as one binary PCD file, whole or not at all; `T_world_sensor` as its VIEWPOINT."""
    rows = packed_rows(columns)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(pcd_header({name: rows.dtype[name] for name in columns}, len(rows), T_world_sensor))
        file.write(rows.tobytes())


def pcd_header(kinds: dict[str, np.dtype], n_points: int, T_world_sensor: Pose | None = None) -> bytes:
    """Return the header of a binary PCD file of columns of some `kinds`."""
    viewpoint = "0 0 0 1 0 0 0"
    if T_world_sensor is not None:
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_matrix(T_world_sensor[:3, :3]).as_quat(canonical=True)
        # In plain digits: a reader of others takes no exponent with a plus sign.
        viewpoint = " ".join(f"{value:.9f}" for value in (*T_world_sensor[:3, 3], w, x, y, z))
    return (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(kinds)}\n"
        f"SIZE {' '.join(str(kind.itemsize) for kind in kinds.values())}\n"
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds.values())}\n"
        f"COUNT {' '.join('1' for _ in kinds)}\n"
        f"WIDTH {n_points}\nHEIGHT 1\nVIEWPOINT {viewpoint}\nPOINTS {n_points}\nDATA binary\n"
    ).encode()


EXPORT = Export(
    writes="folder of .pcd: x y z intensity time ring label instance",
    write=write,
    is_of_points=True,
    per_scan=("*.pcd",),
)
