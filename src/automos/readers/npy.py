"""NumPy files: an (N, 3 or more) array, or a structured one with named columns."""

from __future__ import annotations

from pathlib import Path

from automos.core.errors import InputError
from automos.core.reading import read_array
from automos.readers.columns import Columns, from_matrix


def read(path: Path) -> Columns:
    """Return the columns of one file; unnamed ones are x, y, z, intensity, ring."""
    try:
        array = read_array(path)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(
            f"{path} is not a whole .npy file of numbers ({error}); write it again with numpy.save"
        ) from None
    if array.dtype.names is None and array.dtype.kind not in "fiu":
        raise InputError(f"{path} holds {array.dtype} values; points are numbers")
    if array.dtype.names:
        flat = array.reshape(-1)
        return {name: flat[name] for name in array.dtype.names if flat[name].ndim == 1}
    if array.size == 0:
        array = array.reshape(0, 3)
    return from_matrix(array, path)
