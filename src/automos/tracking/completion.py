"""The whole of every moving object: its segment, and what the segment lacks (the `default` preset's painting).

Ground segmentation takes the lowest part of wheels, bumpers and shoes for ground, because at a hand's height above it
nothing else tells them apart. Around a moving object that is known better: the plane of the ground beside it says what
stands above it. Where an object was out of sight for a moment, what its box holds is its own unless it has stayed.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from automos.cells import whole_below
from automos.kernels import kernel
from automos.settings import CompletionSettings
from automos.tracking.tracks import Tracks

RING = 1.5
"""Metres around an object's box in which the ground beside it is looked for."""
CELL, CELLS = 2.0, 64
"""Metres, edge of the cells in which points beside moving objects are looked for, and after how many they repeat."""
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
    if len(moving) == 0:
        return track_of
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


@kernel
def _extents(points, ids, stayed, boxes, segments):  # type: ignore[no-untyped-def]
    """Return the least (B, 2) and greatest (B, 3) coordinates of boxes, along and across them and up.

    The own extent of a segment is surer than its filtered box; what was not seen has the box.
    """
    low, high = np.full((len(boxes), 2), np.inf), np.full((len(boxes), 3), -np.inf)
    n_segments = 1
    for b in range(len(boxes)):  # `segments.max()` takes a second to compile
        n_segments = max(n_segments, segments[b] + 1)
    box_of = np.full(n_segments, -1)
    for b in range(len(boxes)):
        if segments[b] >= 0:
            box_of[segments[b]] = b
            continue
        for k in range(2):
            low[b, k], high[b, k] = -0.5 * boxes[b, 3 + k], 0.5 * boxes[b, 3 + k]
        high[b, 2] = boxes[b, 2] + 0.5 * boxes[b, 5]
    for i in range(len(points)):
        for segment in (ids[i], stayed[i]):
            b = box_of[segment] if 0 <= segment < len(box_of) else -1
            if b >= 0:
                u, v = _turned(points[i], boxes[b, :3], boxes[b, 6], boxes[b, 7])
                low[b, 0], high[b, 0] = min(low[b, 0], u), max(high[b, 0], u)
                low[b, 1], high[b, 1] = min(low[b, 1], v), max(high[b, 1], v)
                high[b, 2] = max(high[b, 2], points[i, 2])
    return low, high


@kernel
def _rows_near(points, boxes, reaches):  # type: ignore[no-untyped-def]
    """Return the rows of the points that may be within the (B,) reach of a box, and some others.

    Cells seen from above are marked where a box reaches; they repeat every `CELLS`, which costs a few points more.
    """
    is_near = np.zeros((CELLS, CELLS), np.bool_)
    for b in range(len(boxes)):
        n = min(int(2.0 * reaches[b] / CELL) + 2, CELLS) if reaches[b] < CELL * CELLS else CELLS
        x, y = whole_below((boxes[b, 0] - reaches[b]) / CELL), whole_below((boxes[b, 1] - reaches[b]) / CELL)
        for j in range(n):
            for k in range(n):
                is_near[(x + j) % CELLS, (y + k) % CELLS] = True
    rows, n = np.empty(len(points), np.int64), 0
    for i in range(len(points)):
        if is_near[whole_below(points[i, 0] / CELL) % CELLS, whole_below(points[i, 1] / CELL) % CELLS]:
            rows[n] = i
            n += 1
    return rows[:n]


@kernel
def _fill(points, ids, stayed, is_ground, may_move, boxes, segments, tracks, margin, track_of):  # type: ignore[no-untyped-def]
    lows, highs = _extents(points, ids, stayed, boxes, segments)
    reaches = np.empty(len(boxes))
    for b in range(len(boxes)):
        along, across = max(-lows[b, 0], highs[b, 0]), max(-lows[b, 1], highs[b, 1])
        reaches[b] = np.hypot(along, across) + RING + margin
    candidates = _rows_near(points, boxes, reaches)
    near = np.empty(len(candidates), np.int64)
    for b in range(len(boxes)):
        center, c, s, reach = boxes[b, :3], boxes[b, 6], boxes[b, 7], reaches[b]
        low, high = lows[b], highs[b]
        n = 0
        A, rhs, squares = np.zeros((3, 3)), np.zeros(3), 0.0
        for i in candidates:
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


@kernel
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


@kernel(inline="always")
def _turned(point, center, c, s):  # type: ignore[no-untyped-def]
    """Ground coordinates of a point along and across a box."""
    dx, dy = point[0] - center[0], point[1] - center[1]
    return c * dx + s * dy, c * dy - s * dx
