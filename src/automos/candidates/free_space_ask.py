"""Reports of other scans on the points of one scan: which scans report, and the sum of their reports."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial, reduce
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_view import Seen, View
from automos.candidates.free_space_vote import look_through
from automos.candidates.free_space_weigh import Votes, count_hits, sum_votes, weigh_looks
from automos.geometry import inverse
from automos.scan import Mask
from automos.settings import FreeSpaceSettings

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
_PARTS, _PART = 4, 6000
"""Greatest number of parts that a scan's points are split into for threads, and least number of points in a part:
smaller parts do not pay for their overhead."""
SPAN_TOLERANCE = 0.25
"""Share of a span by which the time of the asked scan may be off."""
FIRST_SPANS = (0.6, 1.7, 4.0, 8.0)
"""Seconds: spans asked first; points that these scans agree to have hit have stayed."""
SURE_HITS = 2
"""Number of hits, without any free-space observation, after which no more scans are asked."""


def partners_of(stamp: float, stamps: Array, is_far: Mask, settings: FreeSpaceSettings) -> Rows:
    """Return which scans at `stamps` (N,) report on the one at `stamp`: the nearest to each span, in order.

    The scan itself is not among them. Over longer spans only the scans `is_far` (N,) report. They are `far_step` apart,
    so that few images must be kept for long.
    """
    spans = np.asarray(settings.spans)
    is_long = spans > settings.far_from
    near_ids = _nearest(stamp, stamps, np.arange(len(stamps)), spans[~is_long])
    chosen = np.union1d(near_ids, _nearest(stamp, stamps, np.flatnonzero(is_far), spans[is_long]))
    return chosen[stamps[chosen] != stamp]


def _nearest(stamp: float, stamps: Array, ids: Rows, spans: Array) -> Rows:
    """Return the scans of `ids` nearest to `spans` before and after `stamp`, if near enough."""
    if len(ids) == 0:
        return ids
    wanted = stamp + np.concatenate([-spans[::-1], spans])
    stamps = stamps[ids]
    nearest = np.searchsorted(0.5 * (stamps[1:] + stamps[:-1]), wanted)
    off = np.abs(stamps[nearest] - wanted)
    return ids[nearest[off <= SPAN_TOLERANCE * np.abs(wanted - stamp)]]


def ask(
    mine: Seen, others: list[Seen], offsets: Array, settings: FreeSpaceSettings, pool: ThreadPoolExecutor | None = None
) -> npt.NDArray[np.float32]:
    """Return (M,) the evidence that each point of scan `mine` has moved, from the reports of `others` on its place.

    Positive: has moved; negative: has stayed; 0: unknown, or not an object point.

    Parameters
    ----------
    offsets : (P,) float64, seconds from `mine` to each of the others, increasing.
    pool : ThreadPoolExecutor, optional, shares the work; the result does not depend on it.
    """
    net = np.zeros(len(mine.kind), np.float32)
    for view in mine.views:
        heights = mine.height[view.rows][view.is_object]
        n_parts = 1 if pool is None else max(min(_PARTS, len(heights) // _PART), 1)
        bounds = np.linspace(0, len(heights), n_parts + 1).astype(int)
        parts = [slice(a, b) for a, b in pairwise(bounds)]
        asked = (map if pool is None else pool.map)(partial(_ask_part, view, heights, others, offsets, settings), parts)
        of_view = np.zeros(len(view.is_object), np.float32)
        of_view[view.is_object] = np.concatenate(list(asked))
        net[view.rows] = of_view
    return net


def _ask_part(
    mine: View,
    heights: npt.NDArray[np.float32],
    others: list[Seen],
    offsets: Array,
    settings: FreeSpaceSettings,
    part: slice,
) -> npt.NDArray[np.float32]:
    """Return (K,) the evidence for a `part` of a view's object points; `heights` are those of all object points."""
    points = np.ascontiguousarray(mine.objects[:, part])
    trusts = np.where(mine.is_supported[part], 1.0, settings.lone_weight)
    about = [np.linalg.norm(points, axis=0), heights[part], trusts]
    first = {int(np.argmin(np.abs(offsets - span))) for span in (*FIRST_SPANS, *np.negative(FIRST_SPANS)) if others}
    votes = np.zeros((len(others), len(trusts)), np.int8)
    for k in first:
        votes[k] = _vote(mine, points, about, others[k], settings)
    # Most points are hit by every scan that sees them, so the remaining scans need not report on those.
    ids = np.flatnonzero((votes.max(axis=0, initial=0) > 0) | (count_hits(votes) < SURE_HITS))
    points, about = np.take(points, ids, axis=1), [np.take(column, ids) for column in about]
    for k in set(range(len(others))) - first:
        votes[k, ids] = _vote(mine, points, about, others[k], settings)
    return sum_votes(votes, int(np.searchsorted(offsets, 0.0)), settings.stay_weight)


def _vote(
    mine: View, points: npt.NDArray[np.float32], about: list[npt.NDArray], other: Seen, settings: FreeSpaceSettings
) -> Votes:
    """Return (K,) the vote of another scan on `points` (3, K) of a view; for `about` see `weigh_looks`.

    If that scan has several LiDARs, any hit prevails, otherwise the strongest free-space observation.
    """
    s = settings
    tolerances = tuple(np.float32(x) for x in (s.margin, s.margin_per_metre, s.hit, s.hit_per_metre, s.clear_width))
    votes = []
    for view in other.views:
        T = (inverse(view.T_level_sensor) @ mine.T_level_sensor)[:3].astype(np.float32)
        looks = look_through(points, T, view.rays, tolerances)
        row_height = np.float32(view.rays.pattern.row_height)
        votes.append(weigh_looks(*looks, *about, row_height, s.near_miss, s.weak_weight))
    return reduce(lambda a, b: np.where(np.minimum(a, b) < 0, np.minimum(a, b), np.maximum(a, b)), votes)
