"""How far the faces of tracked boxes go, and how they scatter about their paths.

Medians of a few values are kept by inserting them in order: numba's own takes a second to compile.
"""

from __future__ import annotations

import numpy as np

from automos.kernels import kernel

_ENDS, _AROUND = 5, 3
"""Observations at each end of a track whose median is where it began or ended; on either side, of its path there."""


@kernel
def follow_faces(first, faces):  # type: ignore[no-untyped-def]
    """Return how far each face of each track goes, and the mean square of its path about its running median.

    Parameters
    ----------
    first : (T + 1,) where the observations of each track begin.   faces : (R, F) float64, metres, coordinate of each.

    Returns
    -------
    gone, scatter : (T, F) metres, and square metres. One observation of something else at an end is no path.
    """
    n_tracks, n_faces = len(first) - 1, faces.shape[1]
    gone, scatter = np.empty((n_tracks, n_faces)), np.empty((n_tracks, n_faces))
    for k in range(n_tracks):
        a, b = first[k], first[k + 1]
        n = max(1, min(_ENDS, (b - a) // 3))
        for face in range(n_faces):
            gone[k, face] = _median(faces, b - n, b, face) - _median(faces, a, a + n, face)
            scatter[k, face] = _scatter(faces, a, b, face)
    return gone, scatter


@kernel
def _median(faces, a, b, face):  # type: ignore[no-untyped-def]
    values, m = np.empty(b - a), np.int64(0)  # a bare 0 is a type of its own, compiled for apart
    for i in range(a, b):
        m = _put_in(values, m, faces[i, face])
    return 0.5 * (values[m // 2] + values[(m - 1) // 2])


@kernel
def _scatter(faces, a, b, face):  # type: ignore[no-untyped-def]
    """Return the mean square of a face's path, rows `a` to `b`, about its running median."""
    window = np.empty(2 * _AROUND + 1)  # sorted: one value comes and one goes, which takes a tenth
    m, total = np.int64(0), 0.0
    for i in range(a, min(a + _AROUND, b)):
        m = _put_in(window, m, faces[i, face])
    for i in range(a, b):
        if i - _AROUND > a:
            m = _take_out(window, m, faces[i - _AROUND - 1, face])
        if i + _AROUND < b:
            m = _put_in(window, m, faces[i + _AROUND, face])
        total += (faces[i, face] - 0.5 * (window[m // 2] + window[(m - 1) // 2])) ** 2
    return total / (b - a)


@kernel
def _put_in(values, m, value):  # type: ignore[no-untyped-def]
    """Put `value` in its place among `m` sorted `values`; return how many there are then."""
    at = m
    while at > 0 and values[at - 1] > value:
        values[at] = values[at - 1]
        at -= 1
    values[at] = value
    return m + 1


@kernel
def _take_out(values, m, value):  # type: ignore[no-untyped-def]
    """Take `value` out of `m` sorted `values`; return how many there are then."""
    at = 0
    while at < m - 1 and values[at] != value:
        at += 1
    for k in range(at, m - 1):
        values[k] = values[k + 1]
    return m - 1
