"""E57 files, as terrestrial scanners write them, one scan each, in the scanner's frame; read by pye57.

Its library is not made for damaged files, and ends the process on some: another one reads them.
"""

from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.reading import damage_reported
from automos.readers.apart import read_apart
from automos.readers.columns import Columns


def read(path: Path) -> Columns:
    """Return x, y, z and what else is told of each point: intensity, time, and the row that is its beam."""
    import_extra("pye57", "e57")
    return read_apart("e57", path)


def read_here(path: Path) -> Columns:
    """Return what `read` does, read in this process."""
    with damage_reported(path, "is not a whole E57 file", kinds=Exception):  # damaged files break it in many ways
        file = import_extra("pye57", "e57").E57(str(path))
        if file.scan_count != 1:
            raise InputError(
                f"{path} holds {file.scan_count} scans; export each to a file of its own, in its own frame"
            )
        raw = file.read_scan_raw(0)
    if "sphericalRange" in raw and "cartesianX" not in raw:
        flat = raw["sphericalRange"] * np.cos(raw["sphericalElevation"])
        around, z = raw["sphericalAzimuth"], raw["sphericalRange"] * np.sin(raw["sphericalElevation"])
        columns = {"x": flat * np.cos(around), "y": flat * np.sin(around), "z": z}
    else:
        columns = {axis: raw[f"cartesian{axis.upper()}"] for axis in "xyz"}
    is_none = raw.get("cartesianInvalidState", raw.get("sphericalInvalidState"))
    if is_none is not None:
        columns = {axis: np.where(is_none > 0, 0.0, values) for axis, values in columns.items()}
    told = {"intensity": "intensity", "time": "timeStamp", "ring": "rowIndex"}
    return columns | {name: raw[field] for name, field in told.items() if field in raw}
