"""The paths of the faces of tracked boxes: their velocities within a look, and their scatter about these paths."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

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


@kernel
def face_velocities(first, times, low, high, noise, look):  # type: ignore[no-untyped-def]
    """Return (R, A) the velocities on which both faces agree, and (R,) their standard deviation, inf for single ones.

    low, high : (R, A) coordinates of both faces on each axis.   noise : (T,) metres, of the faces of each track.
    look : seconds before and after an observation to whose path a line is fitted.
    """
    n, n_axes = low.shape
    velocity, deviation = np.zeros((n, n_axes)), np.full(n, np.inf)
    for k in range(len(first) - 1):
        a, b = first[k], first[k]
        for i in range(first[k], first[k + 1]):
            while times[i] - times[a] > look:
                a += 1
            while b < first[k + 1] and times[b] - times[i] <= look:
                b += 1
            middle, spread = 0.0, 0.0
            for j in range(a, b):
                middle += times[j] / (b - a)
            for j in range(a, b):
                spread += (times[j] - middle) ** 2
            if spread <= 0.0:
                continue
            deviation[i] = noise[k] / np.sqrt(spread)
            for axis in range(n_axes):
                below, above = 0.0, 0.0
                for j in range(a, b):
                    below += (times[j] - middle) * low[j, axis] / spread
                    above += (times[j] - middle) * high[j, axis] / spread
                if below * above > 0.0:
                    velocity[i, axis] = below if abs(below) < abs(above) else above
    return velocity, deviation


def _medians(values: Array, begin: Rows, end: Rows) -> Array:
    """Return (K,) the medians of `values` (R,) from each of `begin` to before `end` (K,), which are near each other."""
    n = end - begin
    at = begin[:, None] + np.arange(n.max(initial=1))
    some = np.where(at < end[:, None], values[np.minimum(at, len(values) - 1)], np.inf)
    some.sort(axis=1)
    k = np.arange(len(n))
    return 0.5 * (some[k, n // 2] + some[k, (n - 1) // 2])
