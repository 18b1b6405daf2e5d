"""Point Cloud Library files and polygon files, binary."""

from pathlib import Path

import numpy as np

from automos.core.atomic import write_bytes
from automos.core.geometry import quaternion_of
from automos.core.scan import Pose
from automos.readers.columns import Columns
from automos.readers.point_cloud2 import packed_rows

_PLY_TYPES = {"f4": "float", "u2": "ushort", "u4": "uint"}


def write_pcd(path: Path, columns: Columns, T_world_sensor: Pose | None = None) -> None:
    """Write `columns`, each (N,), as one binary PCD file, whole or not at all; `T_world_sensor` as its VIEWPOINT."""
    write_bytes(path, pcd_bytes(columns, T_world_sensor))


def pcd_bytes(columns: Columns, T_world_sensor: Pose | None = None) -> bytes:
    """Return what is in that file."""
    rows = packed_rows(columns)
    return pcd_header({name: rows.dtype[name] for name in columns}, len(rows), T_world_sensor) + rows.tobytes()


def ply_header(kinds: dict[str, np.dtype], n_points: int | str) -> bytes:
    """Return the header of a binary PLY file of columns of some `kinds`."""
    properties = "".join(f"property {_PLY_TYPES[kind.str[1:]]} {name}\n" for name, kind in kinds.items())
    return f"ply\nformat binary_little_endian 1.0\nelement vertex {n_points}\n{properties}end_header\n".encode()


def pcd_header(kinds: dict[str, np.dtype], n_points: int | str, T_world_sensor: Pose | None = None) -> bytes:
    """Return the header of a binary PCD file of columns of some `kinds`."""
    viewpoint = "0 0 0 1 0 0 0"
    if T_world_sensor is not None:
        x, y, z, w = quaternion_of(T_world_sensor)
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
