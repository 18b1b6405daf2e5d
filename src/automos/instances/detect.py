"""Segments of one scan as the evidence of motion cuts them (the `default` preset's instances).

The whole non-ground scan is segmented, so that the parts of an object no ray looked through (a roof, the middle of a
long side) belong to it all the same. A segment of which the evidence speaks with one voice is an object as it is. One
that holds both what moved and what stayed (a pedestrian beside a wall) is cut: what stayed is taken out and the rest
is segmented again. What has stayed is kept apart, whole as it is: a car that drives away has stayed for as long as it
was parked, and only its track can tell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.instances.boxes import fit_boxes
from automos.instances.segments import segment_points
from automos.kernels import kernel
from automos.settings import DetectSettings

TORN_SHARE = 0.1
"""Of its evidence: a segment with more than this both moved and stayed is torn."""
TORN_POINTS = 20
"""Points, and at least as many as this."""
TORN_GAP = 0.3
"""Metres: at which it is split, if its parts are not torn then."""
SILENCE = 0.2
"""Stayed, of all points: up to this a segment is unknown, not static."""


def detect_objects(
    points: npt.NDArray,
    origin: npt.NDArray,
    log_odds: npt.NDArray[np.floating],
    heights: npt.NDArray[np.float32],
    solidity: npt.NDArray[np.uint8],
    ray_steps: tuple[float, float],
    settings: DetectSettings,
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], Detections]:
    """Return the segments of one scan's points and what the evidence says of every segment.

    Parameters
    ----------
    points : (N, 3) float32 metres, level frame; neither ground nor ego body.   origin : (3,) the sensor's position.
    log_odds : (N,) has moved, against has stayed.   heights : (N,) metres above the ground.
    solidity : (N,) uint8, share of the rays beside a point that ended beside it, 255 for all.
    ray_steps : radians between neighbouring rays, up and sideways.

    Returns
    -------
    objects : (N,) int32, segment of each point, -1 for none; these do not overlap.
    stayed : (N,) int32, segment that has stayed as a whole, -1 for none; numbered after the objects. Where such a
        segment was cut, its pieces are among the objects.
    found : all segments, objects first.
    """
    has_moved, has_stayed = log_odds > settings.min_log_odds, log_odds < -settings.min_log_odds
    seen_from = points - origin.astype(np.float32)
    ranges = np.linalg.norm(seen_from, axis=1)
    rows, columns = ray_steps

    ids = segment_points(seen_from, heights, ranges, rows, columns, settings.segments)
    ids = _split_where_it_tells(ids, seen_from, heights, ranges, ray_steps, has_moved, has_stayed, settings)
    count, moved, stayed, extent = _summarise(ids, points, has_moved, has_stayed)
    speaks_once = _speaks_once(count, moved, stayed, settings)
    is_compact = (count >= settings.min_points) & (extent <= settings.max_side)
    objects = _renumbered(ids, is_compact & speaks_once, 0)

    rest = np.flatnonzero((objects < 0) & (ids >= 0) & ~has_stayed)
    pieces = segment_points(seen_from[rest], heights[rest], ranges[rest], rows, columns, settings.segments)
    count, moved, _, extent = _summarise(pieces, points[rest], has_moved[rest], has_stayed[rest])
    is_piece = (count >= settings.min_points) & (extent <= settings.max_side) & (moved >= 0.5 * count)
    n_whole = int((is_compact & speaks_once).sum())
    objects[rest] = _renumbered(pieces, is_piece, n_whole)

    n_objects = n_whole + int(is_piece.sum())
    silent = _renumbered(ids, is_compact & ~speaks_once, n_objects)
    both = (objects, np.maximum(silent - n_objects, -1))
    parts = [_describe(part, points, heights, solidity, has_moved, has_stayed) for part in both]
    parts[1].has_stayed[:] = True
    found, is_cut = Detections.concatenate(parts), (objects >= 0) & (silent >= 0)
    found.part_of[objects[is_cut]] = silent[is_cut]
    return objects, silent, found


def recount(
    found: Detections,
    ids: npt.NDArray[np.int32],
    stayed: npt.NDArray[np.int32],
    log_odds: npt.NDArray[np.floating],
    settings: DetectSettings,
) -> Detections:
    """Return the same segments with what is known of their points now.

    ids, stayed : (M,) as `detect_objects` gives them.   log_odds : (M,) has moved, against has stayed.
    """
    moved, stayed_points = np.zeros((2, len(found)))
    for part in (ids, stayed):
        moved += np.bincount(part[(part >= 0) & (log_odds > settings.min_log_odds)], minlength=len(found))
        stayed_points += np.bincount(part[(part >= 0) & (log_odds < -settings.min_log_odds)], minlength=len(found))
    speaks_once = _speaks_once(found.n_points, moved, stayed_points, settings)
    has_stayed = np.where(found.part_of >= 0, found.has_stayed, ~speaks_once)
    return replace(found, n_moving=moved, n_static=stayed_points, has_stayed=has_stayed)


def _speaks_once(
    count: npt.NDArray, moved: npt.NDArray, stayed: npt.NDArray, settings: DetectSettings
) -> npt.NDArray[np.bool_]:
    """Return which segments moved as far as the evidence tells, or say next to nothing."""
    return (moved > 0) & (moved >= settings.min_share * (moved + stayed)) | (stayed <= SILENCE * count)


def _split_where_it_tells(
    ids: npt.NDArray[np.int32],
    points: npt.NDArray,
    heights: npt.NDArray[np.float32],
    ranges: npt.NDArray,
    ray_steps: tuple[float, float],
    has_moved: npt.NDArray[np.bool_],
    has_stayed: npt.NDArray[np.bool_],
    settings: DetectSettings,
) -> npt.NDArray[np.int32]:
    """Return `ids` with segments of two voices split at a finer gap, where each part then speaks with one.

    Two trams that pass each other an arm's length apart are one segment, half of it moving; a lorry of which only the
    ends have left their place is one, too, but no finer gap parts its ends from its middle.
    """
    inside, n = ids >= 0, int(ids.max(initial=-1)) + 1
    moved, stayed = (np.bincount(ids[inside & kind], minlength=n) for kind in (has_moved, has_stayed))
    spoken = np.maximum(moved + stayed, 1)
    is_torn = np.minimum(moved, stayed) >= np.maximum(TORN_SHARE * spoken, TORN_POINTS)
    torn = np.flatnonzero(inside & is_torn[ids] if n else inside)
    if not len(torn):
        return ids
    finer = settings.segments.model_copy(update={"gap": TORN_GAP})
    parts = segment_points(points[torn], heights[torn], ranges[torn], *ray_steps, finer)
    n_parts = int(parts.max()) + 2  # one of them is what lies beyond the range looked at, -1
    part = _gapless(ids[torn].astype(np.int64) * n_parts + parts + 1, n * n_parts)
    whole = np.zeros(part.max() + 1, np.int64)
    whole[part] = ids[torn]
    voices = np.stack([np.bincount(part, kind[torn]) for kind in (has_moved, has_stayed)])
    unanimous = np.bincount(whole, voices.max(axis=0), n) >= (1.0 - TORN_SHARE) * spoken
    is_split = unanimous[ids[torn]]
    split = ids.copy()
    split[torn[is_split]] = n + part[is_split]
    split[inside] = _gapless(split[inside], n + len(voices[0]))
    return split


def _describe(
    ids: npt.NDArray[np.int32],
    points: npt.NDArray,
    heights: npt.NDArray[np.float32],
    solidity: npt.NDArray[np.uint8],
    has_moved: npt.NDArray[np.bool_],
    has_stayed: npt.NDArray[np.bool_],
) -> Detections:
    """Return the boxes, counts, lifts and solidity of segments 0, 1, ... of `ids`."""
    count, moved, stayed, _ = _summarise(ids, points, has_moved, has_stayed)
    solid, lift = np.zeros(len(count)), np.full(len(count), np.inf)
    _add_up(ids, heights, solidity, solid, lift)
    boxes = fit_boxes(points, ids, np.ones(len(count)))
    return Detections.of_objects(boxes, count, moved, stayed, lift, solid / 255.0 / np.maximum(count, 1.0))


def _gapless(values: npt.NDArray[np.integer], n: int) -> npt.NDArray[np.int64]:
    """Return `values`, each in 0..n - 1, numbered 0, 1, 2, ... in their order."""
    is_there = np.zeros(n, np.bool_)
    is_there[values] = True
    return (np.cumsum(is_there) - 1)[values]


def _renumbered(ids: npt.NDArray[np.int32], is_kept: npt.NDArray[np.bool_], first: int) -> npt.NDArray[np.int32]:
    """Return `ids` with the kept segments numbered first, first + 1, ..., and -1 for the others."""
    number = np.full(len(is_kept) + 1, -1, np.int32)  # the last entry is for id -1
    number[:-1][is_kept] = first + np.arange(is_kept.sum())
    return number[ids]


@kernel
def _summarise(ids, points, has_moved, has_stayed):  # type: ignore[no-untyped-def]
    """Return count, moved, stayed and ground extent (metres) of each segment."""
    n = 0
    for i in range(len(ids)):
        n = max(n, ids[i] + 1)
    count, moved, stayed = np.zeros(n), np.zeros(n), np.zeros(n)
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    for i in range(len(ids)):
        s = ids[i]
        if s < 0:
            continue
        count[s] += 1
        moved[s] += has_moved[i]
        stayed[s] += has_stayed[i]
        for a in range(2):
            low[s, a] = min(low[s, a], points[i, a])
            high[s, a] = max(high[s, a], points[i, a])
    extent = np.empty(n)
    for s in range(n):
        extent[s] = max(high[s, 0] - low[s, 0], high[s, 1] - low[s, 1])
    return count, moved, stayed, extent


@kernel
def _add_up(ids, heights, solidity, solid, lift):  # type: ignore[no-untyped-def]
    """Write the sum of the solidity of each segment's points, and the height of the lowest."""
    for i in range(len(ids)):
        s = ids[i]
        if s >= 0:
            solid[s] += solidity[i]
            lift[s] = min(lift[s], heights[i])
