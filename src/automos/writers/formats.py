"""The declaration of a writer, what it writes and how; and what most of them write: named columns of each point."""

import hashlib
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_bytes
from automos.core.claims import SIGN
from automos.core.extras import import_extra
from automos.core.geometry import quaternion_of
from automos.core.reading import damage_reported, require_regular
from automos.core.scan import Ints, Mask, Points, Pose, Scan
from automos.readers.columns import Columns
from automos.readers.point_cloud2 import packed_rows
from automos.results.run_files import RunFiles

_MODULES_OF = {
    "arrow": ("pyarrow",), "flow": ("h5py",), "las": ("laspy", "lazrs"), "ncore": ("ncore", "upath"),
    "ros": ("rosbags",),
}  # fmt: skip
"""What writers import of each extra."""


@dataclass(frozen=True)
class Export:
    """A format that results are written in: declared in `EXPORTS` of the module that writes it.

    Attributes
    ----------
    writes : what it makes, in one line.
    write : takes a run and the folder (or file) to write; that folder, or the file's, is there. What it holds already
        is replaced.
    needs : the extra to install, None where the core suffices.
    suffix : of the one file it writes; empty where it writes a folder.
    sign : what that file has in it, by which it is known to be ours.
    is_of_points : whether it holds the recording's points as they are, so that they can be asked for deskewed.
    per_scan : patterns of the files, named after the scans, that readers of the folder take; those of other scans are
        not mixed with them.
    name_of : returns what the results of a recording are called, of its name; no two may be called the same.
    """

    writes: str
    write: Callable[[RunFiles, Path], None]
    needs: str | None = None
    suffix: str = ""
    sign: bytes = SIGN
    is_of_points: bool = False
    per_scan: tuple[str, ...] = ()
    name_of: Callable[[str], str] = str

    @property
    def modules(self) -> tuple[str, ...]:
        """What it imports of the extra."""
        return _MODULES_OF.get(self.needs or "", ())

    def require(self) -> None:
        """Raise MissingExtraError where what it imports is not installed."""
        for module in self.modules:
            import_extra(module, str(self.needs))


def make_folders(out: Path, *names: str) -> None:
    """Make folders below `out` where they are not there."""
    for name in names:
        (out / name).mkdir(parents=True, exist_ok=True)


def copy_file(source: str | Path, target: str | Path) -> None:
    """Copy a plain file, whole or not at all; a device of its name would be copied without end."""
    with damage_reported(source):
        require_regular(Path(source))
    with atomic_path(Path(target)) as temporary:
        shutil.copyfile(source, temporary)


def token_of(run: RunFiles, *parts: object) -> str:
    """Return 32 hexadecimal digits that name `parts` of the recording, the same whenever the same thing is named."""
    return hashlib.sha256(repr((run.sequence.name, *parts)).encode()).hexdigest()[:32]


def scalar_first(T: Pose) -> list[float]:
    """Return the rotation of `T` (4, 4) as nuScenes has it: w, x, y, z."""
    rotation: list[float] = np.roll(quaternion_of(T), 1).round(9).tolist()
    return rotation


def microseconds(run: RunFiles) -> Ints:
    """Return (len(run),) the scans' times, from 0 on where the first is before it."""
    return np.round(1e6 * (run.stamps - min(0.0, float(run.stamps[0])))).astype(np.int64)


def point_columns(run: RunFiles, index: int) -> Columns:
    """Return the (N,) columns of scan `index`, points as the recording has them, or as seen from the scan's pose.

    x, y, z (float32, metres, sensor frame), intensity (float32), time (float32, seconds) and ring (uint16) where the
    recording has them, label (uint16, values of `Label`), instance (uint32, 0: none). Deskewed points are all of one
    time, and come without. Where `run.rows_of` chooses among the points, these come as the recording has them: without
    label and instance.
    """
    scan = run.scan(index)
    columns = scan_columns(scan, run.points_at_pose(scan, index) if run.deskewed else scan.points)
    if run.deskewed:
        columns.pop("time", None)
    if run.rows_of is not None:
        rows = run.rows_of(scan, index)
        return {name: column[rows] for name, column in columns.items()}
    return columns | {
        "label": run.labels(index, len(scan)).astype(np.uint16),
        "instance": run.instances(index, len(scan)).astype(np.uint32),
    }


def scan_columns(scan: Scan, points: Points) -> Columns:
    """Return x, y, z of `points` and what else `scan` has, each (N,)."""
    columns: Columns = {axis: points[:, k] for k, axis in enumerate("xyz")}
    others = {name: getattr(scan, name) for name in ("intensity", "time", "ring")}
    return columns | {name: column for name, column in others.items() if column is not None}


def intensity_of(scan: Scan) -> npt.NDArray[np.float32]:
    """Return (N,) float32, 0 where the recording has none."""
    return np.zeros(len(scan), np.float32) if scan.intensity is None else np.nan_to_num(scan.intensity)


def upright_points(run: RunFiles, index: int) -> Points:
    """Return (M, 4) float32, the points of use of scan `index` in its upright frame, and their intensity."""
    scan = run.scan(index)
    return np.column_stack([run.points_upright(scan, index), intensity_of(scan)])[scan.is_valid].astype(np.float32)


def seen_columns(scan: Scan, points: Points) -> tuple[Columns, Mask]:
    """Return what `scan_columns` does of the points that are finite, as tools show no others, and which are (N,)."""
    is_finite = np.asarray(np.isfinite(points).all(axis=1))
    return {name: column[is_finite] for name, column in scan_columns(scan, points).items()}, is_finite


_PLY_TYPES = {"f4": "float", "u2": "ushort", "u4": "uint"}


def write_pcd(path: Path, columns: Columns, T_world_sensor: Pose | None = None) -> None:
    """Write `columns`, each (N,), as one binary PCD file, whole or not at all; `T_world_sensor` as its VIEWPOINT."""
    write_bytes(path, pcd_bytes(columns, T_world_sensor))


def pcd_bytes(columns: Columns, T_world_sensor: Pose | None = None) -> bytes:
    """Return what is in that file."""
    rows = packed_rows(columns)
    return pcd_header({name: rows.dtype[name] for name in columns}, len(rows), T_world_sensor) + rows.tobytes()


def ply_bytes(columns: Columns) -> bytes:
    """Return `columns`, each (N,), as one binary PLY file."""
    rows = packed_rows(columns)
    return ply_header({name: rows.dtype[name] for name in columns}, len(rows)) + rows.tobytes()


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
