"""Packed float32 rows without header: KITTI's x, y, z, intensity, and its wider and narrower relatives.

Such a file does not say how many columns it has. 5 is taken if it fits every file of the recording and the fifth
column is a ring (whole numbers, as nuScenes writes it), even where 4 fits, too, as it does organised clouds.
Else 4 is taken wherever it fits every file, then 3 if it fits every file and 6 does not. Everything else is asked for.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.readers.columns import Columns, from_matrix

logger = logging.getLogger(__name__)

WIDTHS = {"bin": 4, "bin3": 3, "bin5": 5, "bin6": 6}
"""Columns of each kind."""


def read(path: Path, n_columns: int) -> Columns:
    """Return the columns of one file: x, y, z, intensity, ring; the sixth has no agreed meaning and is left out."""
    values = np.fromfile(path, np.float32)
    size = path.stat().st_size
    if size % (4 * n_columns):
        raise InputError(_bad_size(path, size, n_columns))
    return from_matrix(values.reshape(-1, n_columns), path)


def guess_codec(paths: Sequence[Path]) -> str:
    """Return which of `WIDTHS` the files are, from their sizes (see the module's text).

    Raises
    ------
    InputError
        No number of columns fits all files (one may be cut short), or both 3 and 6 do.
    """
    sizes = [path.stat().st_size for path in paths]
    odd = next((i for i, size in enumerate(sizes) if size % 16), None)
    if _all_multiples(sizes, 20) and _fifth_is_ring(paths[int(np.argmax(sizes))], may_be_zero=odd is not None):
        codec = "bin5"
    elif odd is None:
        return "bin"
    elif _all_multiples(sizes, 24):
        raise InputError(
            f"{paths[odd]} has {sizes[odd]} bytes, which fits 3 and 6 float32 columns but not 4; "
            "say which with --format bin3 or --format bin6"
        )
    elif _all_multiples(sizes, 12) and sum(size % 16 == 0 for size in sizes) < 0.5 * len(sizes):
        codec = "bin3"  # of which a quarter fit 16 bytes; where most do, the odd one is cut, and 12 fit by chance
    else:
        raise InputError(_bad_size(paths[odd], sizes[odd], 4))
    logger.warning("%s: files fit %d float32 columns better than 4; read so", paths[0].parent, WIDTHS[codec])
    return codec


def _all_multiples(sizes: Sequence[int], n_bytes: int) -> bool:
    return all(size % n_bytes == 0 for size in sizes)


def _fifth_is_ring(path: Path, may_be_zero: bool) -> bool:
    rows = np.fromfile(path, np.float32).reshape(-1, 5)
    fifth, are_whole = rows[:, 4], rows == np.floor(rows)
    is_ring = bool((are_whole[:, 4] & (fifth >= 0) & (fifth < 1024)).all())
    # Four columns of points without return are zero, but for intensities: whole, wherever one looks.
    return is_ring and (may_be_zero or (bool(fifth.any()) and not are_whole[:, :3].all()))


def _bad_size(path: Path, size: int, n_columns: int) -> str:
    return (
        f"{path} has {size} bytes, no multiple of a point ({n_columns} float32, {4 * n_columns} bytes); "
        "it may be cut short: copy it again, or name its columns with --format bin3, bin5 or bin6"
    )
