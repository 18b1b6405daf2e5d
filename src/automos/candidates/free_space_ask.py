"""Asking other scans about one: which of them, and what they say of its points all together."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_image import PyramidShape, RangeImage
from automos.candidates.free_space_pattern import BeamPattern
from automos.candidates.free_space_view import Seen, View
from automos.candidates.free_space_vote import look_through
from automos.candidates.free_space_weigh import (
    find_open,
    find_seen_through,
    join_votes,
    sum_votes,
    weaken_lone,
    weigh_looks,
)
from automos.geometry import inverse
from automos.scan import Mask
from automos.settings import FreeSpaceSettings

Array = npt.NDArray[np.float64]
_PARTS, _PART = 4, 6000
"""Into how many parts a scan's points are cut at most where threads share the work, and how many points one has at
least: below that, asking takes less time than being asked."""
SPAN_TOLERANCE = 0.25
"""Of a span, how far off the asked scan may be."""
FIRST_SPANS = (0.6, 1.7, 4.0, 8.0)
"""Seconds: asked first; what they agree to have hit has stayed."""
SURE_HITS = 2
"""Hits without a see-through after which no more scans are asked."""
Looked = tuple[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], BeamPattern, PyramidShape, RangeImage], ...]
"""What the LiDARs of one scan saw, as `look_through` takes it after the points."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What other scans say of one frame's points.

    Attributes
    ----------
    kind : (M,) uint8, OBJECT, GROUND, EGO_BODY or SPECK.
    net : (M,) float32, see-throughs minus hits, weighted; above 0 the point has moved, 0 is unknown. 0 for what is no
        object.
    through, hits : (M,) uint8, how many scans saw through the point and how many hit it again.
    height : (M,) float32, metres above the ground.
    solidity : (M,) uint8, share of the rays beside an object that ended beside it, 255 for all.
    """

    kind: npt.NDArray[np.uint8]
    net: npt.NDArray[np.float32]
    through: npt.NDArray[np.uint8]
    hits: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]
    solidity: npt.NDArray[np.uint8]


def partners_of(stamp: float, stamps: Array, is_far: Mask, settings: FreeSpaceSettings) -> npt.NDArray[np.int64]:
    """Return which of the scans at `stamps` (N,) are asked about one at `stamp`: the nearest to each span, in order.

    The scan itself may be among them. Over the longer spans only those that are `is_far` (N,) are asked, which are
    `far_step` apart, so that only their images need be kept for long.
    """
    spans, far = np.asarray(settings.spans), np.flatnonzero(is_far)
    is_long = spans > settings.far_from
    near_ids = _nearest(stamp, stamps, np.arange(len(stamps)), spans[~is_long])
    return np.union1d(near_ids, _nearest(stamp, stamps, far, spans[is_long]))


def _nearest(stamp: float, stamps: Array, ids: npt.NDArray[np.int64], spans: Array) -> npt.NDArray[np.int64]:
    """Return those of scans `ids` that are nearest to `spans` before and after `stamp`, if near enough."""
    if len(ids) == 0:
        return ids
    wanted = stamp + np.concatenate([-spans[::-1], spans])
    stamps = stamps[ids]
    nearest = np.searchsorted(0.5 * (stamps[1:] + stamps[:-1]), wanted)
    off = np.abs(stamps[nearest] - wanted)
    return ids[nearest[off <= SPAN_TOLERANCE * np.abs(wanted - stamp)]]


def ask(
    mine: Seen,
    others: list[Seen],
    offsets: Array,
    settings: FreeSpaceSettings,
    pool: ThreadPoolExecutor | None = None,
) -> Evidence:
    """Return what `others` say about the points of the scan that saw `mine`.

    offsets : (P,) seconds from it to each of them, increasing.
    pool : threads to share the work; the result does not depend on them.
    """
    n = len(mine.kind)
    net, through, hits = np.zeros(n, np.float32), np.zeros(n, np.uint8), np.zeros(n, np.uint8)
    for view in mine.views:
        heights = mine.height[view.rows][view.is_object]
        told = _ask_about(view, heights, [_looked(view, other) for other in others], offsets, settings, pool)
        net[view.rows], through[view.rows], hits[view.rows] = (_scatter(part, view.is_object) for part in told)
    return Evidence(mine.kind, net, through, hits, mine.height, mine.solidity)


def _ask_about(
    mine: View,
    heights: npt.NDArray[np.float32],
    others: list[Looked],
    offsets: Array,
    settings: FreeSpaceSettings,
    pool: ThreadPoolExecutor | None,
) -> list[npt.NDArray]:
    """Return net, through and hits (K,) of a view's objects; what is said of one point does not depend on others."""
    n_parts = min(_PARTS, len(heights) // _PART)
    if pool is None or n_parts < 2:
        return list(_ask_part(mine, heights, others, offsets, settings))
    parts = np.array_split(np.arange(len(heights)), n_parts)
    views = [
        replace(mine, objects=np.ascontiguousarray(mine.objects[:, rows]), is_supported=mine.is_supported[rows])
        for rows in parts
    ]
    asked = [
        pool.submit(_ask_part, view, heights[rows], others, offsets, settings)
        for view, rows in zip(views, parts, strict=True)
    ]
    return [np.concatenate(column) for column in zip(*(a.result() for a in asked), strict=True)]


def _ask_part(
    mine: View,
    heights: npt.NDArray[np.float32],
    others: list[Looked],
    offsets: Array,
    settings: FreeSpaceSettings,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Return net, through and hits (K,) of a view's objects, which are `heights` (K,) above the ground."""
    n = mine.objects.shape[1]
    ids = np.arange(n)
    own_ranges = np.linalg.norm(mine.objects, axis=0)
    votes = np.zeros((len(others), n), np.int8)
    first = _first_asked(offsets)
    for k in np.flatnonzero(first):
        _add_votes(mine, ids, own_ranges, heights, others[k], settings, votes[k])
    # Most points are hit by all who see them: the others need not be asked about those.
    ids = find_open(votes, first, SURE_HITS)
    for k in np.flatnonzero(~first):
        _add_votes(mine, ids, own_ranges, heights, others[k], settings, votes[k])

    ids = find_seen_through(votes)
    weaken_lone(votes, ids, mine.is_supported[ids], settings.lone_weight)

    net, through, hits = np.empty(n, np.float32), np.empty(n, np.uint8), np.empty(n, np.uint8)
    sum_votes(votes, int(np.searchsorted(offsets, 0.0)), settings.stay_weight, net, through, hits)
    return net, through, hits


def _first_asked(offsets: Array) -> npt.NDArray[np.bool_]:
    """Return which of the scans at `offsets` (P,) are nearest to the spans that are asked first."""
    first = np.zeros(len(offsets), np.bool_)
    if len(offsets):
        spans = np.asarray(FIRST_SPANS)
        for span in (*-spans, *spans):
            first[np.argmin(np.abs(offsets - span))] = True
    return first


def _add_votes(
    mine: View,
    ids: npt.NDArray[np.int64],
    own_ranges: npt.NDArray,
    heights: npt.NDArray,
    other: Looked,
    settings: FreeSpaceSettings,
    votes: npt.NDArray[np.int8],
) -> None:
    """Write into `votes` (K,) what another scan says about the points `ids` of a view."""
    s = settings
    tolerances = tuple(np.float32(x) for x in (s.margin, s.margin_per_metre, s.hit, s.hit_per_metre, s.clear_width))
    points = mine.objects if len(ids) == mine.objects.shape[1] else np.take(mine.objects, ids, axis=1)
    codes = np.empty(len(ids), np.uint8)
    ranges, misses = np.empty(len(ids), np.float32), np.empty(len(ids), np.float32)
    for k, looked in enumerate(other):
        look_through(points, *looked, tolerances, codes, ranges, misses)
        said = votes if k == 0 else np.zeros_like(votes)
        pitch = np.float32(looked[2].row_height)
        weigh_looks(codes, ranges, misses, own_ranges, heights, pitch, s.near_miss, s.weak_weight, ids, said)
        if k > 0:
            join_votes(votes, said)


def _looked(mine: View, other: Seen) -> Looked:
    """Return what the LiDARs of another scan saw, for points in the frame of `mine`."""
    T_other_mine = [(inverse(view.T_level_sensor) @ mine.T_level_sensor)[:3].astype(np.float32) for view in other.views]
    return tuple(
        (T, view.motion, view.pattern, view.pyramid, view.image)
        for T, view in zip(T_other_mine, other.views, strict=True)
    )


def _scatter(values: npt.NDArray, is_object: npt.NDArray[np.bool_]) -> npt.NDArray:
    out = np.zeros(len(is_object), values.dtype)
    out[is_object] = values
    return out
