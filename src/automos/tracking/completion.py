"""The whole of every moving object: its segment, and what the segment lacks (the `default` preset's painting).

Ground segmentation takes the lowest part of wheels, bumpers and shoes for ground, because at a hand's height above it
nothing else sets them apart. Around a moving object that is known better: the plane of the ground beside it says what
stands above it. Where an object was out of sight for a moment, what its box holds is its own unless it has stayed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.kernels import kernel
from automos.scan import Mask
from automos.settings import CompletionSettings
from automos.tracking.tracks import Tracks

Ids = npt.NDArray[np.int32]
Array = npt.NDArray[np.float64]
RING = 1.5
"""Metres around an object's box in which the ground beside it is looked for."""
MIN_GROUND = 10
"""Points of ground beside an object that show where the ground beneath it is."""
CLEARANCE = (0.03, 0.1)
"""Metres above the ground beside it, from which on it is the object: at least, at most."""
ROUGHNESS = 3.0
"""Between them, in standard deviations of the ground beside it about its plane: a floor is set apart from a shoe on it
at a few centimetres, cobbles and a verge are not."""


def paint_objects(
    points: npt.NDArray,
    ids: Ids,
    stayed: Ids,
    is_ground: Mask,
    may_move: Mask,
    moving: Tracks,
    settings: CompletionSettings,
) -> Ids:
    """Return (M,) int32 the moving track that each of one scan's points belongs to, -1 for none.

    Parameters
    ----------
    points : (M, 3) metres, level frame.
    ids : (M,) segment of each point, -1 for none.   stayed : (M,) segment that has stayed as a whole, -1 for none.
    is_ground : (M,) points taken for ground.
    may_move : (M,) points that belong to nothing known to have stayed (ego body excluded).
    moving : the rows of moving tracks in this scan, observed or predicted.
    """
    track_of, margin = tracks_of_points(ids, stayed, moving), settings.margin
    owned, near = np.flatnonzero(track_of >= 0), np.empty(len(points), np.int32)
    for k in range(len(moving.track)):
        segment, center, size = moving.segment[k], moving.center[k], moving.size[k]
        turn = np.cos(moving.yaw[k]), np.sin(moving.yaw[k])
        # The own extent of a segment is surer than its filtered box; what was not seen has the box.
        low, high = np.array([-0.5, 0.5])[:, None] * size
        if segment >= 0:
            own = owned[(ids[owned] == segment) | (stayed[owned] == segment)]
            own = _in_box(points[own], center, turn)
            low, high = own.min(axis=1), own.max(axis=1)
        reach = np.hypot(*np.maximum(-low[:2], high[:2])) + RING + margin
        rows = near[: _find_near(points, center, reach, near)]
        local = _in_box(points[rows], center, turn)
        outside = np.maximum(low[:2, None] - local[:2], local[:2] - high[:2, None]).max(axis=0)
        is_mine = (outside <= margin) & (local[2] <= high[2] + margin) & may_move[rows] & (track_of[rows] < 0)
        is_beside = is_ground[rows] & (outside > margin) & (outside <= RING + margin)
        must_stand = is_ground[rows] | (segment >= 0)
        is_mine &= ~must_stand | _stands(local, local[:, is_beside])
        track_of[rows[is_mine]] = moving.track[k]
    return track_of


def tracks_of_points(ids: Ids, stayed: Ids, tracks: Tracks) -> Ids:
    """Return (M,) the track among those of one scan that each point's segment belongs to, or its whole; -1 for none."""
    track_of_segment = np.full(max(ids.max(initial=-1), stayed.max(initial=-1)) + 2, -1, np.int32)
    track_of_segment[tracks.segment[tracks.is_observed]] = tracks.track[tracks.is_observed]
    return np.where(track_of_segment[ids] >= 0, track_of_segment[ids], track_of_segment[stayed])


def _in_box(points: npt.NDArray, center: Array, turn: tuple[float, float]) -> Array:
    """Return (3, K) coordinates of `points` (K, 3) along and across a box with that heading (cosine, sine), and up."""
    (x, y, z), (c, s) = (points - center).T, turn
    return np.stack([c * x + s * y, c * y - s * x, z])


def _stands(points: Array, ground: Array) -> Mask:
    """Return (K,) which of `points` (3, K) stand above the plane of the `ground` (3, G) beside them."""
    n = ground.shape[1]
    if n < MIN_GROUND:
        return np.zeros(points.shape[1], np.bool_)
    base = np.stack([*ground[:2], np.ones(n)])
    moments = base @ ground[2]
    plane = np.linalg.solve(base @ base.T + np.diag([1e-3 * n, 1e-3 * n, 0.0]), moments)
    roughness = np.sqrt(max(float(ground[2] @ ground[2] - plane @ moments), 0.0) / n)
    above = points[2] - (plane[0] * points[0] + plane[1] * points[1] + plane[2])
    return above >= np.clip(ROUGHNESS * roughness, *CLEARANCE)


@kernel
def _find_near(points, center, reach, rows):  # type: ignore[no-untyped-def]
    """Write the `rows` of points whose x and y are within `reach` of those of `center`; return how many there are."""
    n = 0
    for i in range(len(points)):
        if abs(points[i, 0] - center[0]) <= reach and abs(points[i, 1] - center[1]) <= reach:
            rows[n] = i
            n += 1
    return n
