"""The declaration of a writer, what it writes and how; and the frame of most of them: named columns of each point.

LAS stores coordinates as multiples of a step, here a tenth of a millimetre. Coordinates that are not finite, or too
large for that, become 0, 0, 0, as drivers write "no return". The label is the classification and, with the instance, an
extra dimension.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_bytes
from automos.core.claims import SIGN
from automos.core.geometry import quaternion_of
from automos.core.scan import Mask, Points, Pose, Scan
from automos.readers.columns import Columns
from automos.readers.formats import import_extra
from automos.readers.point_cloud2 import packed_rows
from automos.results.run_files import RunFiles


@dataclass(frozen=True)
class Export:
    """A format that results are written in: declared in `EXPORTS` of the module that writes it.

    Attributes
    ----------
    writes : what it makes, in one line.
    write : takes a run and the folder (or file) to write; what is there already is replaced.
    needs : the extra to install, None where the core suffices.
    modules : what it imports of that extra; looked for before anything is made.
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
    modules: tuple[str, ...] = ()
    suffix: str = ""
    sign: bytes = SIGN
    is_of_points: bool = False
    per_scan: tuple[str, ...] = ()
    name_of: Callable[[str], str] = str

    def require(self) -> None:
        """Raise MissingExtraError where what it imports is not installed."""
        for module in self.modules:
            import_extra(module, str(self.needs))


def make_folders(out: Path, *names: str) -> None:
    """Make folders below `out` where they are not there."""
    for name in names:
        (out / name).mkdir(parents=True, exist_ok=True)


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
    for name in ("intensity", "time", "ring"):
        column = getattr(scan, name)
        if column is not None:
            columns[name] = column
    return columns


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


STEP = 1e-4
"""Metres: the grid of the coordinates."""
REACH = (2**31 - 1) * STEP
"""Metres that 32 bits reach: 214 km."""


def laz_packer(run: RunFiles) -> Callable[[int], bytes]:
    """Return what packs the scans of `run`: all in one unit of intensity."""
    laspy = import_extra("laspy", "las")
    scale = _intensity_scale(run)

    def packed(index: int) -> bytes:
        columns = point_columns(run, index)
        header = laspy.LasHeader(version="1.4", point_format=6)
        header.scales, header.offsets = np.full(3, STEP), np.zeros(3)
        extra = {name: columns[name] for name in ("label", "ring", "instance") if name in columns}
        header.add_extra_dims([laspy.ExtraBytesParams(name, column.dtype) for name, column in extra.items()])
        las = laspy.LasData(header)
        xyz = np.column_stack([columns[axis] for axis in "xyz"])
        xyz = np.where((np.abs(xyz) < REACH).all(axis=1)[:, None], xyz, np.float32(0.0))
        las.x, las.y, las.z = xyz.astype(np.float64).T
        if "label" in columns:
            las.classification = columns["label"].astype(np.uint8)
        if "intensity" in columns:
            las.intensity = _to_16_bits(columns["intensity"], scale)
        if "time" in columns:
            las.gps_time = columns["time"].astype(np.float64) + run.stamps[index]
        for name, column in extra.items():
            las[name] = column
        content = io.BytesIO()  # what packs does not tell a full disk from other faults
        las.write(content, do_compress=True)
        return content.getvalue()

    return packed


def _intensity_scale(run: RunFiles) -> float:
    """Return what intensities are multiplied by, the same in all scans: 65535 where none is above 1, else 1.

    Of counts, the first scan shows it, and no other is read.
    """
    found = (run.scan(index).intensity for index in range(len(run)))
    are_shares = all(intensity is None or not (_finite(intensity) > 1.0).any() for intensity in found)
    return 65535.0 if are_shares else 1.0


def _to_16_bits(intensity: np.ndarray, scale: float) -> np.ndarray:
    """Return (N,) uint16: intensities times `scale`, in bounds."""
    return np.clip(np.round(_finite(intensity) * scale), 0, 65535).astype(np.uint16)


def _finite(intensity: np.ndarray) -> np.ndarray:
    return np.nan_to_num(intensity, nan=0.0, posinf=0.0, neginf=0.0)
