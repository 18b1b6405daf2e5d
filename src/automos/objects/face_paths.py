"""The paths of the faces of tracked boxes: how unsteady they are, and how far a track went."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.objects.looks import MEMORY
from automos.objects.motion import smooth_paths, ways_around
from automos.objects.tracker import LONGEST_STEP

Array = npt.NDArray[np.float64]
LEAST_SCATTER = 0.05  # metres, of the faces of a box
SLIDES = 3.0  # how much faster than the sensor segments of scenery slide, at most
_MOMENTS = 64  # of a path that are looked at, at most


def path_terms(first: npt.NDArray[np.int64], times: Array, faces: Array) -> tuple[Array, Array, Array, Array]:
    """Return (T,) scatter of centres, metres, and two logarithms: of unsteady heights, and of a track's way; (R,) ways.

    These are metres, how far a track goes in the second about a sight.

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
    gone = np.linalg.norm(ways_around(first, times, path, np.zeros(len(path))), axis=1)
    displaced = np.log1p(way * np.sqrt(_averaged(first, times, 2)) / scatter)
    return scatter, np.log1p(unsteady), displaced, gone


def _averaged(first: npt.NDArray[np.int64], times: Array, free: int) -> Array:
    """Return (T,) how many sights say where a path ends: all but `free` that any path fits, of `MEMORY` at most.

    What slid when it came into sight has not gone farther once it stood for minutes.
    """
    n, at = np.diff(first), np.append(times, 0.0)
    duration = np.where(n > 0, at[first[1:] - 1] - at[first[:-1]], 0.0)
    return np.maximum(n - free, 0.0) * MEMORY / np.maximum(duration, MEMORY)


def way_beyond(
    first: npt.NDArray[np.int64], times: Array, ends: npt.NDArray[np.floating], sensor: npt.NDArray[np.floating]
) -> Array:
    """Return (T,) the logarithm of the way that both ends of a track went while the sensor hardly did.

    What a sensor sees of fences and walls changes as it drives, so their segments go with it; and where something
    nearer hides an end, that of the segment is not the thing's. Both ends of a thing that went are elsewhere, in the
    same direction. The farthest way of each in any interval counts, less `SLIDES` times the sensor's own in that
    interval, in standard deviations about the smoothed path, which goes through any three sights. After `LONGEST_STEP`
    without a sight it may be another thing that is seen.

    first, times : see `path_terms`.   ends : (R, 2, 2), and sensor : (R, 2), see `SegmentTerms`.

    Equation: way
    """
    track = np.repeat(np.arange(len(first) - 1), np.diff(first))
    own = SLIDES * np.cumsum(np.linalg.norm(np.diff(sensor, axis=0, prepend=sensor[:1]), axis=1))
    way, beyond = np.zeros((2, len(first) - 1, 2)), np.zeros((2, len(first) - 1))
    for side in range(2):
        rows = np.flatnonzero(np.isfinite(ends[:, side, 0]))
        at = np.searchsorted(rows, first)
        path, _, _ = smooth_paths(at, times[rows], np.pad(ends[rows, side], ((0, 0), (0, 1))))
        off = ((ends[rows, side] - path[:, :2]) ** 2).sum(axis=1)
        n = np.diff(at)
        scatter = np.sqrt(np.bincount(track[rows], off, len(n)) / np.maximum(n, 1)) + LEAST_SCATTER
        sight = np.cumsum(np.diff(times[rows], prepend=0.0) >= LONGEST_STEP)
        _farthest(at, path, own[rows], sight, way[side], beyond[side])
        beyond[side] *= np.sqrt(_averaged(at, times[rows], 3)) / scatter
    return np.where((way[0] * way[1]).sum(axis=1) > 0.0, np.log1p(beyond.min(axis=0)), 0.0)


@kernel
def _farthest(first, path, own, sight, way, beyond):  # type: ignore[no-untyped-def]
    """Write the farthest way (T, 2) in a sight of each path, and by how much (T,) it exceeds the own way meanwhile."""
    for t in range(len(beyond)):
        step = (first[t + 1] - first[t]) // _MOMENTS + 1
        for i in range(first[t], first[t + 1], step):
            for j in range(i + step, first[t + 1], step):
                if sight[j] > sight[i]:
                    break
                x, y = path[j, 0] - path[i, 0], path[j, 1] - path[i, 1]
                longer = np.sqrt(x * x + y * y) - (own[j] - own[i])
                if longer > beyond[t]:
                    beyond[t], way[t, 0], way[t, 1] = longer, x, y
