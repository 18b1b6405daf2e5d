"""Displacement of the faces of tracked boxes, and their scatter about their paths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
_ENDS, _AROUND = 5, 3
"""Observations at each end of a track for the median that is its start or end, and on either side for the path."""


def follow_faces(first: npt.NDArray[np.int64], faces: Array) -> tuple[Array, Array]:
    """Return the displacement of each face of each track, and the mean square of its path about its running median.

    Both are (T, F), metres and square metres; `first` (T + 1,) is the first observation of each track among the
    coordinates `faces` (R, F). Medians suppress single outliers at an end.
    """
    begin, end = first[:-1], first[1:]
    length = end - begin
    n = np.clip(length // 3, 1, _ENDS)
    track, row = np.repeat(np.arange(len(length)), length), np.arange(len(faces))
    low, high = np.maximum(row - _AROUND, begin[track]), np.minimum(row + _AROUND + 1, end[track])
    displacement, scatter = np.empty((2, len(length), faces.shape[1]))
    for k, path in enumerate(faces.T):
        displacement[:, k] = _medians(path, end - n, end) - _medians(path, begin, begin + n)
        scatter[:, k] = np.bincount(track, (path - _medians(path, low, high)) ** 2, len(length)) / length
    return displacement, scatter


def _medians(values: Array, begin: npt.NDArray[np.int64], end: npt.NDArray[np.int64]) -> Array:
    """Return (K,) the medians of `values` (R,) from each of `begin` to before `end` (K,), which are near each other."""
    n = end - begin
    at = begin[:, None] + np.arange(n.max(initial=1))
    some = np.where(at < end[:, None], values[np.minimum(at, len(values) - 1)], np.inf)
    some.sort(axis=1)
    k = np.arange(len(n))
    return 0.5 * (some[k, n // 2] + some[k, (n - 1) // 2])
