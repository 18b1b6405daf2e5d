"""Compressed LAS files, one per scan, for the tools of surveyors.

LAS stores coordinates as multiples of a step, here a tenth of a millimetre. Coordinates that are not finite, or too
large for that, become 0, 0, 0, as drivers write "no return". The label is the classification and, with the instance, an
extra dimension.
"""

import io
from collections.abc import Callable

import numpy as np

from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles
from automos.writers.formats import point_columns

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
