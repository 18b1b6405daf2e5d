"""The scatter of the faces of tracked boxes about their paths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
_AROUND = 3  # observations on either side for the running median


def face_scatter(first: Rows, faces: Array) -> Array:
    """Return (T, F) the mean square of the path of each face of each track about its running median, square metres.

    `first` (T + 1,) is the first observation of each track among the coordinates `faces` (R, F).
    """
    begin, length = first[:-1], np.diff(first)
    track, row = np.repeat(np.arange(len(length)), length), np.arange(len(faces))
    low, high = np.maximum(row - _AROUND, begin[track]), np.minimum(row + _AROUND + 1, first[1:][track])
    scatter = np.empty((len(length), faces.shape[1]))
    for k, path in enumerate(faces.T):
        scatter[:, k] = np.bincount(track, (path - _medians(path, low, high)) ** 2, len(length)) / np.maximum(length, 1)
    return scatter


def _medians(values: Array, begin: Rows, end: Rows) -> Array:
    """Return (K,) the medians of `values` (R,) from each of `begin` to before `end` (K,), which are near each other."""
    n = end - begin
    at = begin[:, None] + np.arange(n.max(initial=1))
    some = np.where(at < end[:, None], values[np.minimum(at, len(values) - 1)], np.inf)
    some.sort(axis=1)
    k = np.arange(len(n))
    return 0.5 * (some[k, n // 2] + some[k, (n - 1) // 2])
