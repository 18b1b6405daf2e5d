"""Points in LAS, packed as LAZ.

Coordinates are multiples of a step, here a tenth of a millimetre. Those that are not finite, or too large for that,
become 0, 0, 0, as drivers write "no return". The label is the classification and, with the instance, an extra
dimension.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import write_bytes
from automos.core.extras import import_extra
from automos.readers.columns import Columns
from automos.results.run_files import RunFiles
from automos.writers.formats import Export, point_columns

STEP = 1e-4
"""Metres: the grid of the coordinates."""
REACH = (2**31 - 1) * STEP
"""Metres that 32 bits reach: 214 km."""


def las_header() -> Any:
    """Return the header of a file of points that have a label."""
    header = import_extra("laspy", "las").LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, STEP), np.zeros(3)
    return header


def _write_laz(run: RunFiles, out: Path) -> None:
    """Write `out / <name>.laz` of every scan, all in one unit of intensity."""
    scale = _intensity_scale(run)
    for index in run.each("writing .laz"):
        packed = _packed(point_columns(run, index), float(run.stamps[index]), scale)
        write_bytes(out / f"{run.names[index]}.laz", packed)


def _packed(columns: Columns, stamp: float, scale: float) -> bytes:
    laspy, header = import_extra("laspy", "las"), las_header()
    extra = {name: columns[name] for name in ("label", "ring", "instance") if name in columns}
    header.add_extra_dims([laspy.ExtraBytesParams(name, column.dtype) for name, column in extra.items()])
    las = laspy.LasData(header)
    xyz = np.column_stack([columns[axis] for axis in "xyz"])
    xyz = np.where((np.abs(xyz) < REACH).all(axis=1)[:, None], xyz, np.float32(0.0))
    las.x, las.y, las.z = xyz.astype(np.float64).T
    if "label" in columns:
        las.classification = columns["label"].astype(np.uint8)
    if "intensity" in columns:
        las.intensity = np.clip(np.round(_finite(columns["intensity"]) * scale), 0, 65535).astype(np.uint16)
    if "time" in columns:
        las.gps_time = columns["time"].astype(np.float64) + stamp
    for name, column in extra.items():
        las[name] = column
    return las_bytes(las)


def las_bytes(las: Any, is_laz: bool = True) -> bytes:
    """Return what is in the file of `las`; what compresses does not tell a full disk from other faults."""
    content = io.BytesIO()
    las.write(content, do_compress=is_laz)
    return content.getvalue()


def _intensity_scale(run: RunFiles) -> float:
    """Return what intensities are multiplied by, the same in all scans: 65535 where none is above 1, else 1.

    Of counts, the first scan shows it, and no other is read.
    """
    found = (run.scan(index).intensity for index in range(len(run)))
    are_shares = all(intensity is None or not (_finite(intensity) > 1.0).any() for intensity in found)
    return 65535.0 if are_shares else 1.0


def _finite(intensity: np.ndarray) -> np.ndarray:
    return np.nan_to_num(intensity, nan=0.0, posinf=0.0, neginf=0.0)


EXPORTS = {
    "laz": Export(
        "folder of .laz: classification, gps_time, extra dimensions",
        _write_laz,
        needs="las",
        is_of_points=True,
        per_scan=("*.laz",),
    )
}
