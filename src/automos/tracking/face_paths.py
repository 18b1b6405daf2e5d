"""Displacement of the faces of tracked boxes, and their scatter about their paths.

Medians use sorted insertion of a few values, because numba's own median takes a second to compile.
"""

from __future__ import annotations

import numpy as np

from automos.kernels import kernel

_ENDS, _AROUND = 5, 3
"""Observations at each end of a track for the median that is its start or end, and on either side for the path."""


@kernel
def follow_faces(first, faces):  # type: ignore[no-untyped-def]
    """Return the displacement of each face of each track, and the mean square of its path about its running median.

    Both are (T, F), metres and square metres; `first` (T + 1,) is the first observation of each track among the
    coordinates `faces` (R, F). Medians suppress single outliers at an end.
    """
    n_tracks, n_faces = len(first) - 1, faces.shape[1]
    displacement, scatter = np.empty((n_tracks, n_faces)), np.empty((n_tracks, n_faces))
    for k in range(n_tracks):
        a, b = first[k], first[k + 1]
        n = max(1, min(_ENDS, (b - a) // 3))
        for face in range(n_faces):
            displacement[k, face] = _median(faces, b - n, b, face) - _median(faces, a, a + n, face)
            scatter[k, face] = _scatter(faces, a, b, face)
    return displacement, scatter


@kernel
def _median(faces, a, b, face):  # type: ignore[no-untyped-def]
    values, m = np.empty(b - a), np.int64(0)  # a literal 0 has its own type in numba and would be compiled separately
    for i in range(a, b):
        m = _insert(values, m, faces[i, face])
    return 0.5 * (values[m // 2] + values[(m - 1) // 2])


@kernel
def _scatter(faces, a, b, face):  # type: ignore[no-untyped-def]
    """Return the mean square of a face's path, rows `a` to `b`, about its running median."""
    window = np.empty(2 * _AROUND + 1)  # sorted: inserting one value and removing one takes a tenth of the time
    m, total = np.int64(0), 0.0
    for i in range(a, min(a + _AROUND, b)):
        m = _insert(window, m, faces[i, face])
    for i in range(a, b):
        if i - _AROUND > a:
            m = _remove(window, m, faces[i - _AROUND - 1, face])
        if i + _AROUND < b:
            m = _insert(window, m, faces[i + _AROUND, face])
        total += (faces[i, face] - 0.5 * (window[m // 2] + window[(m - 1) // 2])) ** 2
    return total / (b - a)


@kernel
def _insert(values, m, value):  # type: ignore[no-untyped-def]
    """Insert `value` into `m` sorted `values`; return their new number."""
    at = m
    while at > 0 and values[at - 1] > value:
        values[at] = values[at - 1]
        at -= 1
    values[at] = value
    return m + 1


@kernel
def _remove(values, m, value):  # type: ignore[no-untyped-def]
    """Remove `value` from `m` sorted `values`; return their new number."""
    at = 0
    while at < m - 1 and values[at] != value:
        at += 1
    for k in range(at, m - 1):
        values[k] = values[k + 1]
    return m - 1
