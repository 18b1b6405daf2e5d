"""The whole of every moving object: its segment, and what the segment lacks (the `default` preset's painting).

Ground segmentation takes the lowest part of wheels, bumpers and shoes for ground, because at a hand's height above it
nothing else tells them apart. Around a moving object that is known better: the plane of the ground beside it says what
stands above it. Where an object was out of sight for a moment, what its box holds is its own unless it has stayed.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from automos.settings import CompletionSettings
from automos.tracking.tracks import Tracks

RING = 1.5
"""Metres around an object's box in which the ground beside it is looked for."""
CLEARANCE = (0.03, 0.1)
"""Metres above the ground beside it, from which on it is the object: at least, at most."""
ROUGHNESS = 3.0
"""Between them, in standard deviations of the ground beside it about its plane: a floor is told from a shoe on it at
a few centimetres, cobbles and a verge are not."""


def paint_objects(
    points: npt.NDArray,
    ids: npt.NDArray[np.int32],
    stayed: npt.NDArray[np.int32],
    is_ground: npt.NDArray[np.bool_],
    may_move: npt.NDArray[np.bool_],
    moving: Tracks,
    settings: CompletionSettings,
) -> npt.NDArray[np.int32]:
    """Return (M,) int32 the moving track that each of one scan's points belongs to, -1 for none.

    Parameters
    ----------
    points : (M, 3) metres, level frame.
    ids : (M,) segment of each point, -1 for none.   stayed : (M,) segment that has stayed as a whole, -1 for none.
    is_ground : (M,) points taken for ground.
    may_move : (M,) points that belong to nothing known to have stayed (ego body excluded).
    moving : the rows of moving tracks in this scan, observed or predicted.
    """
    track_of = tracks_of_points(ids, stayed, moving)
    segment_of_row = np.where(moving.is_observed, moving.segment, -1)
    boxes = np.column_stack([moving.center, moving.size, np.cos(moving.yaw), np.sin(moving.yaw)])
    _fill(
        np.asarray(points), ids, stayed, is_ground, may_move, boxes, segment_of_row, moving.track.astype(np.int32),
        settings.margin, track_of,
    )  # fmt: skip
    return track_of


def tracks_of_points(
    ids: npt.NDArray[np.int32], stayed: npt.NDArray[np.int32], tracks: Tracks
) -> npt.NDArray[np.int32]:
    """Return (M,) the track among those of one scan that each point's segment belongs to, or its whole; -1 for none."""
    track_of_segment = np.full(max(ids.max(initial=-1), stayed.max(initial=-1)) + 2, -1, np.int32)
    track_of_segment[tracks.segment[tracks.is_observed]] = tracks.track[tracks.is_observed]
    return np.where(track_of_segment[ids] >= 0, track_of_segment[ids], track_of_segment[stayed])


@numba.njit(cache=True, nogil=True)
def _fill(points, ids, stayed, is_ground, may_move, boxes, segments, tracks, margin, track_of):  # type: ignore[no-untyped-def]
    near = np.empty(len(points), np.int64)
    for b in range(len(boxes)):
        center, half, c, s = boxes[b, :3], 0.5 * boxes[b, 3:6], boxes[b, 6], boxes[b, 7]
        if segments[b] >= 0:  # the segment's own extent is surer than the filtered box
            low, high = np.full(3, np.inf), np.full(3, -np.inf)
            for i in range(len(points)):
                if ids[i] == segments[b] or stayed[i] == segments[b]:
                    u, v = _turned(points[i], center, c, s)
                    low[0], high[0] = min(low[0], u), max(high[0], u)
                    low[1], high[1] = min(low[1], v), max(high[1], v)
                    high[2] = max(high[2], points[i, 2])
        else:
            low, high = np.array([-half[0], -half[1], 0.0]), np.array([half[0], half[1], center[2] + half[2]])
        reach = np.hypot(max(-low[0], high[0]), max(-low[1], high[1])) + RING + margin
        n = 0
        A, rhs, squares = np.zeros((3, 3)), np.zeros(3), 0.0
        for i in range(len(points)):
            if abs(points[i, 0] - center[0]) > reach or abs(points[i, 1] - center[1]) > reach:
                continue
            u, v = _turned(points[i], center, c, s)
            beyond = max(max(low[0] - u, u - high[0]), max(low[1] - v, v - high[1]))
            if beyond <= margin:
                if points[i, 2] <= high[2] + margin:
                    near[n] = i
                    n += 1
            elif beyond <= RING + margin and is_ground[i]:
                row, height = (u, v, 1.0), points[i, 2] - center[2]
                squares += height * height
                for j in range(3):
                    rhs[j] += row[j] * height
                    for k in range(3):
                        A[j, k] += row[j] * row[k]
        if A[2, 2] < 10.0:  # too little ground beside it to know where it is below
            plane, clearance = (0.0, 0.0, np.inf), 0.0
        else:
            count, moments = A[2, 2], rhs.copy()
            A[0, 0] += 1e-3 * A[2, 2]
            A[1, 1] += 1e-3 * A[2, 2]
            plane = _solve(A, rhs)
            explained = plane[0] * moments[0] + plane[1] * moments[1] + plane[2] * moments[2]
            roughness = math.sqrt(max(squares - explained, 0.0) / count)
            clearance = min(max(ROUGHNESS * roughness, CLEARANCE[0]), CLEARANCE[1])
        for k in range(n):
            i = near[k]
            if track_of[i] >= 0 or not may_move[i]:
                continue
            if is_ground[i] or segments[b] >= 0:
                u, v = _turned(points[i], center, c, s)
                if points[i, 2] - center[2] - (plane[0] * u + plane[1] * v + plane[2]) < clearance:
                    continue
            track_of[i] = tracks[b]


@numba.njit(cache=True, nogil=True)
def _solve(A, b):  # type: ignore[no-untyped-def]
    """Return x of A x = b for a positive definite (3, 3) `A`, both spoilt; LAPACK's takes seconds to compile."""
    for k in range(2):
        for j in range(k + 1, 3):
            f = A[j, k] / A[k, k]
            b[j] -= f * b[k]
            for i in range(k + 1, 3):
                A[j, i] -= f * A[k, i]
    z = b[2] / A[2, 2]
    y = (b[1] - A[1, 2] * z) / A[1, 1]
    return (b[0] - A[0, 1] * y - A[0, 2] * z) / A[0, 0], y, z


@numba.njit(cache=True, nogil=True, inline="always")
def _turned(point, center, c, s):  # type: ignore[no-untyped-def]
    """Ground coordinates of a point along and across a box."""
    dx, dy = point[0] - center[0], point[1] - center[1]
    return c * dx + s * dy, c * dy - s * dx
