"""Polygon files, binary, one per scan."""

from __future__ import annotations

from pathlib import Path

from automos.core.atomic import atomic_path
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import packed_rows, point_columns

_TYPES = {"f4": "float", "u2": "ushort", "u4": "uint"}


def write(run: RunFiles, out: Path) -> None:
    """Write every scan as `out / <name>.ply` with the columns of `point_columns`."""
    out.mkdir(parents=True, exist_ok=True)
    for index in run.each("writing .ply"):
        columns = point_columns(run, index)
        rows = packed_rows(columns)
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
        header += "".join(f"property {_TYPES[column.dtype.str[1:]]} {name}\n" for name, column in columns.items())
        with atomic_path(out / f"{run.names[index]}.ply") as temporary, temporary.open("wb") as file:
            file.write(f"{header}end_header\n".encode())
            file.write(rows.tobytes())


EXPORT = Export(
    writes="folder of .ply: x y z intensity time ring label instance",
    write=write,
    is_of_points=True,
    per_scan=("*.ply",),
)
