"""NumPy files: an (N, 3 or more) array, its transpose, an image, or a structured one with named columns; or several.

One that holds several scans is a recording of its own, see `stacked`.
"""

from pathlib import Path

import numpy as np

from automos.core.array_rows import are_scans
from automos.core.errors import InputError
from automos.core.reading import MAX_TEXT, damage_reported, read_array
from automos.readers.columns import MAX_COLUMNS, UNNAMED, Columns, from_matrix
from automos.readers.record_layout import names_of
from automos.readers.records import columns_of_field

_POINTS = ("points", "point_cloud", "pointcloud", "pc", "cloud", "lidar", "scan", "xyzi", "xyz", "data", "arr_0")
"""What archives call the array of points, where they hold others, too."""
_POSE = 4
"""Rows and columns that a pose has, or what is known of a camera, which lies beside the points of some."""
WIDEST = 2 * len(UNNAMED)
"""Columns that lie behind one another, at most: an array of more rows has a point in each."""


def read(path: Path, columns: str = "") -> Columns:
    """Return the columns of one file; unnamed ones are x, y, z, intensity, ring, or as `columns` names them."""
    array, beside = _points_in(load(path), path)
    if array is None:
        return beside
    if array.dtype.names is None and array.dtype.kind not in "fiu":
        raise InputError(f"{path} holds {array.dtype} values; points are numbers")
    if scans := stack_in(array):
        raise InputError(f"{path} holds {len(scans)} scans, an array of shape {array.shape}; give this file itself")
    if array.dtype.names:
        flat, found = array.reshape(-1), Columns()
        for name in array.dtype.names:
            found |= columns_of_field(name, flat[name])
    else:
        rows = array.reshape(0, 3) if array.size == 0 else as_rows(array)
        found = from_matrix(rows, path, names_of(rows, path, columns))
    n = len(next(iter(found.values()), ()))
    return found | {name: column for name, column in beside.items() if len(column) == n}


def load(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays in a file by their names; `points` is the only one of a .npy.

    Raises
    ------
    InputError
        Not such a file, or one that is not whole.
    """
    with damage_reported(path, "is not a whole .npy file of numbers", "write it again with numpy.save"):
        return _read_archive(path) if path.suffix.lower() == ".npz" else {"points": read_array(path)}


def stack_in(array: np.ndarray) -> list[np.ndarray] | None:
    """Return the scans of an array that holds several, (S, N, C), (S, C, N) or structured (S, N); none of one scan.

    None where its points do not tell which of both it is.
    """
    names = {name.lower(): name for name in array.dtype.names or ()}
    if array.ndim == 3 and len(array) > WIDEST >= array.shape[1] >= 3 and array.shape[2] > MAX_COLUMNS:
        array = array.swapaxes(1, 2)
    points = array
    if array.ndim == 2 and {"x", "y", "z"} <= set(names):
        points = np.stack([array[names[axis]] for axis in "xyz"], axis=-1)
    if points.ndim < 3 or len(points) < 2 or points.dtype.kind not in "fiu":
        return []
    if not 3 <= points.shape[2] <= min(MAX_COLUMNS, points.shape[1] - 1):  # as many columns as rows: matrices
        return []
    are_several = are_scans(points)
    return None if are_several is None else list(array) if are_several else []


def as_rows(matrix: np.ndarray) -> np.ndarray:
    """Return a row for each point of an array that may be an image, (H, W, C) or (C, H, W), or have (C, N) rows."""
    if matrix.ndim == 3 and 3 <= len(matrix) <= WIDEST < matrix.shape[2]:
        matrix = matrix.reshape(len(matrix), -1)
    if matrix.ndim == 3 and matrix.shape[2] <= MAX_COLUMNS:
        matrix = matrix.reshape(-1, matrix.shape[2])
    if matrix.ndim == 2 and 3 <= len(matrix) <= WIDEST and matrix.shape[1] > MAX_COLUMNS:
        matrix = matrix.T
    return matrix


def _read_archive(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as archive:
        if sum(entry.file_size for entry in archive.zip.infolist()) > MAX_TEXT:
            raise ValueError(f"its arrays unpack to more than {MAX_TEXT >> 20} MB")
        # those of Python's objects are left out, which others keep beside the points
        starts = {file.removesuffix(".npy"): archive.zip.open(file).read(200) for file in archive.zip.namelist()}
        return {name: _flat(archive[name]) for name in archive.files if b"'|O'" not in starts[name]}


def _flat(array: np.ndarray) -> np.ndarray:
    """Return an array of a number a point, (N, 1) or (1, N), as (N,), others as they are."""
    is_flat = array.ndim == 2 and 1 in array.shape and array.shape[1] not in range(2, MAX_COLUMNS + 1)
    return array.reshape(-1) if is_flat else array


def _points_in(arrays: dict[str, np.ndarray], path: Path) -> tuple[np.ndarray | None, Columns]:
    """Return a file's array of points, None where there is one for each axis, and those of a number a point."""
    if len(arrays) == 1:
        return next(iter(arrays.values())), {}
    rows = {name: array for name, array in arrays.items() if array.ndim == 1 and not array.dtype.names}
    if {"x", "y", "z"} <= {name.lower() for name in rows}:
        n = len(next(array for name, array in rows.items() if name.lower() == "x"))
        return None, {name: array for name, array in rows.items() if len(array) == n}
    clouds = [name for name, array in arrays.items() if array.ndim > 1 or array.dtype.names]
    named = [name for name in _POINTS if name in clouds]
    clouds = clouds if named else [name for name in clouds if max(arrays[name].shape) > _POSE]
    if not named and len(clouds) != 1:
        raise InputError(f"{path} holds the arrays {', '.join(arrays) or 'none'}; call the one of points 'points'")
    return arrays[(named or clouds)[0]], rows
