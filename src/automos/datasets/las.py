"""LAS and LAZ files, as surveyors write them, one sweep each, in the sensor's frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automos.datasets.columns import Columns
from automos.datasets.formats import import_extra
from automos.errors import InputError

FARTHEST = 20_000.0
"""Metres: no sensor sees so far, so coordinates beyond it are a map's and not the sensor's."""


def read(path: Path) -> Columns:
    """Return x, y, z, intensity, `time` (the GPS time) and the extra dimensions of one file.

    Raises
    ------
    InputError
        A damaged file, or coordinates of a map: what moves is seen from where the sensor was.
    """
    laspy = import_extra("laspy", "las")
    if path.suffix.lower() == ".laz":
        import_extra("lazrs", "las")
    try:
        las = laspy.read(path)
    except OSError:
        raise
    except Exception as error:  # damaged files break the library in many ways
        raise InputError(f"{path} is no whole LAS file ({error}); copy it again") from error
    names = set(las.point_format.dimension_names)
    columns: Columns = {axis: np.asarray(las[axis], np.float64) for axis in "xyz"}
    if len(las) and max(np.abs(columns["x"]).max(), np.abs(columns["y"]).max()) > FARTHEST:
        raise InputError(
            f"{path} has coordinates of a map ({columns['x'][0]:.0f}, {columns['y'][0]:.0f}); give sweeps in the "
            "sensor's frame"
        )
    if "intensity" in names:
        columns["intensity"] = np.asarray(las.intensity)
    if "gps_time" in names:
        columns["time"] = np.asarray(las.gps_time)
    extra = (name for name in las.point_format.extra_dimension_names if las[name].ndim == 1)
    return columns | {name: np.asarray(las[name]) for name in extra}
