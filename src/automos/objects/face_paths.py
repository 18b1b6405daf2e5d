"""The paths of the faces of tracked boxes: how unsteady they are, and how far a track went."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.objects.motion import smooth_paths

Array = npt.NDArray[np.float64]
LEAST_SCATTER = 0.05  # metres, of the faces of a box


def path_terms(first: npt.NDArray[np.int64], times: Array, faces: Array) -> tuple[Array, Array, Array]:
    """Return (T,) each: scatter of centres, metres, and two logarithms: of unsteady heights, and of a track's way.

    The way from first to last counts in standard deviations of the centres about their smoothed path, as segments of
    scenery slide and jump while they come into sight. Two sights show no scatter: some path goes through any two.

    first : (T + 1,) the first observation of each track.   times : (R,) seconds.   faces : (R, 4), see `SegmentTerms`.

    Equation: way
    """
    path, _, _ = smooth_paths(first, times, faces)
    begin, n = first[:-1], np.diff(first)
    track = np.repeat(np.arange(len(n)), n)
    squared = [np.bincount(track, column, len(n)) / np.maximum(n, 1) for column in ((faces - path) ** 2).T]
    unsteady = np.sqrt(np.minimum(squared[2], squared[3])) / LEAST_SCATTER
    way, is_there = np.zeros(len(n)), n > 0
    way[is_there] = np.linalg.norm((path[first[1:][is_there] - 1] - path[begin[is_there]])[:, :2], axis=1)
    scatter = np.sqrt(squared[0] + squared[1]) + LEAST_SCATTER
    return scatter, np.log1p(unsteady), np.log1p(way * np.sqrt(np.maximum(n - 2.0, 0.0)) / scatter)
