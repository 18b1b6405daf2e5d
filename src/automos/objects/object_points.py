"""From objects to points: which points belong to moving objects, and how certain each point's label is.

Ground segmentation takes the lowest part of wheels, bumpers and shoes for ground, because only height separates them
from it. Beside a moving object there is a better reference: the plane of the ground there shows which points are above
it. If an object was missed in a scan, the points in its predicted box are assigned to it unless they have stayed.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import EGO_BODY, GROUND, OBJECT, SPECK, Mask
from automos.objects.detections import Detections
from automos.objects.tracks import Tracks
from automos.settings import CompletionSettings

Ids = npt.NDArray[np.int32]
RINGS = 1.5, 4.0  # metres around an object's box in which points are the ground beside it: the wider where few are
MIN_GROUND = 10  # least number of ground points beside an object for a plane
ROUGHNESS, CLEARANCE = 3.0, (0.03, 0.1)
"""Height above the ground plane from which points belong to the object, in standard deviations of the ground about its
plane, and limits of that height, metres: on a floor a few centimetres separate a shoe, on cobbles they do not."""
_MIN_MOVED, _MAX_LIFT = 5, 2.5
"""Limits for a moving segment, of whose points half have moved: how many, and greatest height of its lowest, metres."""
_PRIOR, _WEIGHT = -4.0, 2.0
"""Prior log-odds of moving of a point without an object, and weight of the evidence: in simulated worlds, of the points
without an object 2 in 100 move if no scan reports on them, and 1 in 1000 if they were hit again."""


def paint_objects(
    points: npt.NDArray,
    about: Mapping[str, npt.NDArray],
    found: Mapping[str, npt.NDArray],
    moving: Tracks,
    parts: Tracks,
    settings: CompletionSettings,
    is_told_apart: bool = False,
) -> Ids:
    """Return (M,) int32 the moving track that each of one scan's points belongs to, -1 for none (`default`).

    Parameters
    ----------
    points : (M, 3) float, metres, level frame.
    about : `kind` (M,) of each point, OBJECT, GROUND, ..., and `log_odds` (M,) of having moved.
    found : `ids` (M,), the segment of each point, and `stayed` (M,), that which has stayed as a whole; -1 for none.
    moving : Tracks, the rows of moving tracks in this scan, observed or predicted.   parts : all their segments.
    is_told_apart : whether it is known what stands there in other scans (`places`). Two solid bodies are never in one
        place, so all else in the box of one is of it, whatever the evidence on a point by itself says; but where most
        of what is in a box has stayed, the box is wrong.
    """
    ids, stayed, is_ground = found["ids"], found["stayed"], about["kind"] == GROUND
    has_stayed, is_ego = about["log_odds"] < 0.0, about["kind"] == EGO_BODY
    track_of, margin = tracks_of_points(ids, stayed, parts), settings.margin
    owned = np.flatnonzero(track_of >= 0)
    for k in range(len(moving.track)):
        segment, center, size = moving.segment[k], moving.center[k], moving.size[k]
        turn = np.cos(moving.yaw[k]), np.sin(moving.yaw[k])
        low, high = np.array([-0.5, 0.5])[:, None] * size
        if segment >= 0:
            own = owned[(ids[owned] == segment) | (stayed[owned] == segment)]
            own = _in_box(points[own], center, turn)
            # Where nobody knows what stands there, a kind's usual width and height may be farther than its own.
            n_whole, lowest, highest = 3 if is_told_apart else 1, own.min(axis=1), own.max(axis=1)
            low = np.r_[np.minimum(low, lowest)[:n_whole], lowest[n_whole:]]
            high = np.r_[np.maximum(high, highest)[:n_whole], highest[n_whole:]]
        reach = np.hypot(*np.maximum(-low[:2], high[:2])) + RINGS[-1] + margin
        rows, local, outside = _around(points, center, turn, low[:2], high[:2], reach)
        is_free = ~is_ego[rows] & (track_of[rows] < 0)
        is_mine = (outside <= margin) & (local[2] <= high[2] + margin) & ~has_stayed[rows] & is_free
        if is_told_apart:
            is_within = (np.abs(local) <= 0.5 * size[:, None]).all(axis=0) & has_stayed[rows] & is_free
            if np.count_nonzero(is_within) <= np.count_nonzero(track_of[rows] == moving.track[k]):
                is_mine |= is_within
        distances = outside[is_ground[rows] & (outside > margin)] - margin
        ring = next((ring for ring in RINGS if np.count_nonzero(distances <= ring) >= MIN_GROUND), RINGS[0])
        is_beside = is_ground[rows] & (outside > margin) & (outside <= ring + margin)
        must_stand = is_ground[rows] | (segment >= 0)
        # Far away little ground is seen, and a body's lowest part is taken for it: more in it than around it.
        n_inside = int(np.count_nonzero(is_ground[rows] & (outside <= margin)))
        is_own = bool(segment >= 0 and n_inside > np.count_nonzero(is_beside))
        is_mine &= ~must_stand | _stands(local, local[:, is_beside], is_own | ~is_ground[rows])
        track_of[rows[is_mine]] = moving.track[k]
    return track_of


def tracks_of_points(ids: Ids, stayed: Ids, tracks: Tracks) -> Ids:
    """Return (M,) the track of each point's segment, or else of its stayed segment, in one scan; -1 for none."""
    track_of_segment = np.full(max(ids.max(initial=-1), stayed.max(initial=-1)) + 2, -1, np.int32)
    track_of_segment[tracks.segment[tracks.is_observed]] = tracks.track[tracks.is_observed]
    return np.where(track_of_segment[ids] >= 0, track_of_segment[ids], track_of_segment[stayed])


def _in_box(points: npt.NDArray, center: Array, turn: tuple[float, float]) -> Array:
    """Return (3, K) coordinates of `points` (K, 3) along, across and above a box; `turn` is cosine, sine of its yaw."""
    (x, y, z), (c, s) = (points - center).T, turn
    return np.stack([c * x + s * y, c * y - s * x, z])


def _stands(points: Array, ground: Array, if_unknown: Mask) -> Mask:
    """Return (K,) which of `points` (3, K) are above the plane of the `ground` (3, G) beside them, if it is known."""
    n = ground.shape[1]
    if n < MIN_GROUND:
        return if_unknown
    base = np.stack([*ground[:2], np.ones(n)])
    moments = base @ ground[2]
    plane = np.linalg.solve(base @ base.T + 1e-3 * n * np.diag([1.0, 1.0, 0.0]), moments)
    roughness = np.sqrt(max(float(ground[2] @ ground[2] - plane @ moments), 0.0) / n)
    above = points[2] - (plane[0] * points[0] + plane[1] * points[1] + plane[2])
    return above >= np.clip(ROUGHNESS * roughness, *CLEARANCE)


@kernel
def _around(points, center, turn, low, high, reach):  # type: ignore[no-untyped-def]
    """Return the rows (K,) of points whose x and y are within `reach` of those of `center`, and where they are.

    Second and third are their coordinates in the box (3, K), see `_in_box`, and how far (K,) they are outside its
    sides, from `low` to `high` along and across it, metres.
    """
    rows, local, outside, n = np.empty(len(points), np.int32), np.empty((3, len(points))), np.empty(len(points)), 0
    for i in range(len(points)):
        x, y = points[i, 0] - center[0], points[i, 1] - center[1]
        if abs(x) <= reach and abs(y) <= reach:
            along, across = turn[0] * x + turn[1] * y, turn[0] * y - turn[1] * x
            rows[n], local[0, n], local[1, n], local[2, n] = i, along, across, points[i, 2] - center[2]
            outside[n] = max(low[0] - along, along - high[0], low[1] - across, across - high[1])
            n += 1
    return rows[:n], local[:, :n], outside[:n]


def find_moved(ids: Ids, found: Detections) -> Mask:
    """Return (M,) bool: points of one scan in segments, `ids` (M,) of `found`, that consist mostly of moved points.

    At a scan rate too low for tracking, this decides. An object whose place was observed free before and after has
    moved, while tracks would associate different objects and predict them at places that nothing passed.
    """
    moves = (found.n_moving >= np.maximum(0.5 * found.n_points, _MIN_MOVED)) & (found.lift <= _MAX_LIFT)
    return np.append(moves & ~found.has_stayed, False)[ids]  # the last entry is for id -1


def point_confidence(
    is_moving: Mask, owner: Ids, confidence: Array, log_odds: npt.NDArray[np.floating], kind: npt.NDArray[np.uint8]
) -> npt.NDArray[np.uint8]:
    """Return (M,) uint8, 255 for certain: the probability that each point's label is right.

    The points of an object have the `confidence` (T,) of the verdict on its track, ground has 1, and for all other
    points it follows from the evidence, their `log_odds` (M,) of having moved. `is_moving` (M,) are the points labelled
    moving, `owner` (M,) is the track of each, moving or not, -1 for none, and `kind` (M,) its OBJECT, GROUND, ...

    Equation: point
    """
    moves = 1.0 / (1.0 + np.exp(-(_PRIOR + _WEIGHT * log_odds.astype(np.float32))))
    stands = (kind == OBJECT) | (kind == SPECK)
    alone = np.where(stands, 1.0 - moves, 1.0)
    by_track = np.append(confidence, 1.0)[owner]
    return np.round(255.0 * np.where((owner >= 0) & (is_moving | stands), by_track, alone)).astype(np.uint8)
