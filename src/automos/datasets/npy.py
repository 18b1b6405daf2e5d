"""NumPy files: an (N, 3 or more) array, or a structured one with named columns."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from automos.datasets.columns import Columns, from_matrix
from automos.errors import InputError


def _require_whole(path: Path) -> None:
    """Raise ValueError where the file is no array, or does not hold what its header promises."""
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
        promised, got = math.prod(shape) * dtype.itemsize, path.stat().st_size - file.tell()
    if min(shape, default=1) < 0 or promised != got:
        raise ValueError(f"its header promises {promised} bytes of shape {shape}, but it holds {got}")


def read(path: Path) -> Columns:
    """Return the columns of one file; unnamed ones are x, y, z, intensity, ring."""
    try:
        _require_whole(path)
        array = np.load(path, allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # damaged headers, which are Python, break their parser in many ways
        why = " ".join(str(error).split())
        raise InputError(
            f"{path} is not a whole .npy file of numbers ({why}); write it again with numpy.save"
        ) from None
    if array.dtype.names is None and array.dtype.kind not in "fiu":
        raise InputError(f"{path} holds {array.dtype} values; points are numbers")
    if array.dtype.names:
        flat = array.reshape(-1)
        return {name: flat[name] for name in array.dtype.names if flat[name].ndim == 1}
    if array.size == 0:
        array = array.reshape(0, 3)
    return from_matrix(array, path)
