"""Point Cloud Library files, binary, one per scan."""

from __future__ import annotations

from pathlib import Path

import numpy.typing as npt

from automos.core.atomic import atomic_path
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import packed_rows, point_columns


def write(run: RunFiles, out: Path) -> None:
    """Write every scan as `out / <name>.pcd` with the columns of `point_columns`."""
    out.mkdir(parents=True, exist_ok=True)
    for index in run.each("writing .pcd"):
        write_pcd(out / f"{run.names[index]}.pcd", point_columns(run, index))


def write_pcd(path: Path, columns: dict[str, npt.NDArray]) -> None:
    """Write `columns`, each (N,), as one binary PCD file, whole or not at all."""
    rows = packed_rows(columns)
    kinds = [rows.dtype[name] for name in columns]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(columns)}\n"
        f"SIZE {' '.join(str(kind.itemsize) for kind in kinds)}\n"
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}\n"
        f"COUNT {' '.join('1' for _ in kinds)}\n"
        f"WIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA binary\n"
    )
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(header.encode())
        file.write(rows.tobytes())


EXPORT = Export(
    writes="folder of .pcd: x y z intensity time ring label instance",
    write=write,
    is_of_points=True,
    per_scan=("*.pcd",),
)
