"""LAS and LAZ files, as surveyors write them, one sweep each, in the sensor's frame.

What unpacks LAZ (lazrs) calls itself without end on some damaged files, which no process survives: another one does it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automos.datasets.apart import read_apart
from automos.datasets.columns import Columns
from automos.datasets.foreign import limited
from automos.datasets.formats import import_extra
from automos.datasets.las_header import is_packed, require_whole
from automos.errors import InputError


def read(path: Path) -> Columns:
    """Return x, y, z, intensity, `time` (the GPS time) and the extra dimensions of one file.

    Raises
    ------
    InputError
        A damaged file.
    """
    import_extra("laspy", "las")
    if not is_packed(path):
        return read_here(path)
    import_extra("lazrs", "las")
    return read_apart("las", path)


def read_here(path: Path) -> Columns:
    """Return what `read` does, read in this process."""
    laspy = import_extra("laspy", "las")
    try:
        n_points = require_whole(path)
        with limited(path):
            las = laspy.read(path)
    except (OSError, InputError):
        raise
    except Exception as error:  # damaged files break the library in many ways
        raise InputError(f"{path} is not a complete LAS file ({error}); copy it again") from error
    if len(las) != n_points:
        raise InputError(f"{path} is cut short: {len(las)} points, its header promises {n_points}; copy it again")
    names = set(las.point_format.dimension_names)
    columns: Columns = {axis: np.asarray(las[axis], np.float64) for axis in "xyz"}
    if "intensity" in names:
        columns["intensity"] = np.asarray(las.intensity)
    if "gps_time" in names:
        columns["time"] = np.asarray(las.gps_time)
    extra = (name for name in las.point_format.extra_dimension_names if las[name].ndim == 1)
    return columns | {name: np.asarray(las[name]) for name in extra}
