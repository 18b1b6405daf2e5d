"""Bodies: which tracklets are one moving thing.

*Parts* are found in `parts.py`.

*Links.* What ends and what begins is one body if place, velocity and extent agree as the motion model expects after
the time between: through occlusion, and through standing. Every end has one beginning at most, and every beginning one
end: the assignment with the greatest likelihood over the recording.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, starmap

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import log_expit

from automos.core.scan import Mask
from automos.objects.association import LEAST_SIDE, assign
from automos.objects.looks import looks
from automos.objects.motion import ACCELERATION, NOISE, smooth_paths
from automos.objects.parts import LONGEST, lies_within
from automos.objects.tracker import until_last_seen
from automos.objects.tracks import Tracks, observed, without_gaps

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
REACH = 3.0  # standard deviations
BIRTHS = 3e-4
"""Bodies that come into sight, per square metre and square metre per second squared: the alternative to a link."""


def cut_where_two(tracks: Tracks, is_moving: Mask, evidence: Array, times: Array) -> Tracks:
    """Return `tracks` as more tracks: moving ones are cut at gaps over which two bodies are likelier than one.

    is_moving : (T,)
    evidence : (R,) log-likelihood ratio of each row, moved against stayed; NaN where it was missed.
    times : (N,) seconds of the scans.

    Of a body that comes out from behind something one end is where it seems to be, and its centre is not: it goes on if
    its centre does, or either end.

    Equation: link
    """
    at = np.flatnonzero(tracks.is_observed & is_moving[tracks.track])
    seen, t = tracks[at], times[tracks.scan[at]]
    first = seen.first_of_sights()
    bounds = np.append(first, len(t))
    goes_on = np.flatnonzero(seen.track[first[1:]] == seen.track[first[1:] - 1]) + 1
    rows = first[goes_on]
    gap, to_end, scores = t[rows] - t[rows - 1], _to_ends(seen), []
    for side in (-1.0, 0.0, 1.0):
        position, velocity, variance = smooth_paths(bounds, t, seen.center + side * to_end)
        at_side = replace(seen, center=position, velocity=velocity)
        scores.append(_link_score(at_side, rows - 1, rows, gap, variance[:, 0], side != 0.0))
    score = np.max(scores, axis=0)
    about = evidence[at]
    away = _share_away(seen)
    score += log_expit(away[rows] * _said(about, t, bounds, bounds[1:] - 1)[goes_on - 1])
    score += log_expit(away[rows - 1] * _said(about, t, bounds, first)[goes_on])
    is_cut = np.diff(tracks.track, prepend=-1) > 0
    is_cut[at[rows[score <= 0.0]]] = True
    return until_last_seen(replace(tracks, track=np.cumsum(is_cut) - 1))


def _to_ends(tracks: Tracks) -> Array:
    """Return (R, 3) metres from the centre of each box to its end in the direction of its track's way."""
    first = tracks.first_rows()
    n = np.diff(np.append(first, len(tracks.track)))
    way = tracks.center[first + n - 1] - tracks.center[first]
    angle = np.repeat(np.arctan2(way[:, 1], way[:, 0]), n)
    c, s = np.cos(angle), np.sin(angle)
    turn = tracks.yaw - angle
    half = 0.5 * (np.abs(np.cos(turn)) * tracks.size[:, 0] + np.abs(np.sin(turn)) * tracks.size[:, 1])
    return np.stack([c * half, s * half, 0.0 * half], axis=-1)


def _said(evidence: Array, times: Array, first: Rows, at: Rows) -> Array:
    """Return (S,) the log-odds that each sight is of what moved, by its rows near the time of its row `at` (S,).

    What stands and then leaves its place has moved in the seconds before, too, as scans after say.
    """
    seen = np.flatnonzero(np.isfinite(evidence))
    sight = np.repeat(np.arange(len(at)), np.diff(first))[seen]
    said = evidence[seen] * looks(np.searchsorted(seen, first), times[seen])
    is_near = np.abs(times[seen] - times[at][sight]) <= LONGEST
    return np.asarray(np.bincount(sight[is_near], said[is_near], len(at)), np.float64)


def _share_away(tracks: Tracks) -> Array:
    """Return (R,) the share of the time near each row in which its motion takes a body away from where it is.

    What moves slowly was there itself in most of the scans that are compared, and only the others say anything.
    """
    way = LONGEST * np.hypot(*tracks.velocity[:, :2].T)
    return 1.0 - np.minimum(tracks.size[:, :2].max(axis=1) / np.maximum(way, NOISE), 1.0)


def links_in_time(tracks: Tracks, is_moving: Mask, is_whole: Mask, evidence: Array, times: Array) -> tuple[Rows, Rows]:
    """Return the tracks (K,) that go on, and those (K,) as which they do.

    is_moving, is_whole : (T,), tracks that move, and those that are no part of another; of what is linked, one moves.
    evidence : (R,) see `cut_where_two`.
    times : (N,) seconds of the scans.

    Equation: link
    """
    first = tracks.first_rows()
    last = np.append(first[1:], len(tracks.track))[: len(first)] - 1
    t, bounds = times[tracks.scan], np.append(first, len(tracks.track))
    ended, begun = (_said(evidence, t, bounds, at) for at in (last, first))
    away = _share_away(tracks)

    def likely(a: Rows, b: Rows, rows: Rows) -> tuple[Rows, Rows, Array]:
        possible = (a != b) & is_whole[a] & is_whole[b]
        a, b, rows = a[possible], b[possible], rows[possible]
        stands = ~is_moving[a] & ~is_moving[b]
        score = _link_score(tracks, rows, first[b], t[first[b]] - t[rows], stands=stands)
        score += np.where(is_moving[a], 0.0, log_expit(away[first[b]] * ended[a]))
        score += np.where(is_moving[b], 0.0, log_expit(away[rows] * begun[b]))
        return a[score > 0.0], b[score > 0.0], score[score > 0.0]

    found = starmap(likely, chain(_followed(tracks, first, last, times), _overlapping(tracks, first, last)))
    a, b, score = (np.concatenate(column) for column in zip(*found, strict=True))
    ends, beginnings = np.zeros((2, 0), np.int64)
    is_body = is_moving.copy()
    while True:  # a body goes on through all that stands where it stood
        free = (is_body[a] | is_body[b]) & ~np.isin(a, ends) & ~np.isin(b, beginnings)
        if not free.any():
            return ends, beginnings
        more = _one_each(a[free], b[free], score[free], len(first))
        ends, beginnings = np.append(ends, more[0]), np.append(beginnings, more[1])
        is_body[ends] = is_body[beginnings] = True


def _one_each(a: Rows, b: Rows, score: Array, n: int) -> tuple[Rows, Rows]:
    """Return those of the pairs (P,) of `n` tracks, one of each `a` and `b` at most, that have the greatest score."""
    _, group = connected_components(coo_array((np.ones(len(a)), (a, n + b)), shape=(2 * n, 2 * n)), directed=False)
    order = np.argsort(group[a], kind="stable")
    chosen: list[tuple[Rows, Rows]] = [(np.zeros(0, np.int64),) * 2]
    for rows in np.split(order, np.flatnonzero(np.diff(group[a][order])) + 1):
        ends, beginnings = np.unique(a[rows]), np.unique(b[rows])
        cost = np.full((len(ends), len(beginnings)), np.inf)
        np.minimum.at(cost, (np.searchsorted(ends, a[rows]), np.searchsorted(beginnings, b[rows])), -score[rows])
        i, j = assign(cost)
        chosen.append((ends[i], beginnings[j]))
    ends, beginnings = (np.concatenate(column) for column in zip(*chosen, strict=True))
    return ends, beginnings


def _followed(tracks: Tracks, first: Rows, last: Rows, times: Array) -> Iterator[tuple[Rows, Rows, Rows]]:
    """Yield pairs of tracks (P,), the second of which begins near the end of the first, and the last rows of that.

    By the scan in which the first one ends: in most pairs nothing goes on, and a recording has very many.
    """
    in_time = np.argsort(tracks.scan[first], kind="stable")
    begin, center = times[tracks.scan[first[in_time]]], tracks.center[first[in_time], :2]
    reach = LONGEST * np.hypot(*tracks.velocity[last, :2].T) + REACH * (NOISE + ACCELERATION * LONGEST)
    in_order = np.argsort(tracks.scan[last], kind="stable")
    for a in np.split(in_order, np.flatnonzero(np.diff(tracks.scan[last[in_order]])) + 1):
        end = times[tracks.scan[last[a[:1]]]].sum()  # 0 where there are none
        low, high = np.searchsorted(begin, (end, end + LONGEST), side="right")
        off = np.linalg.norm(center[low:high] - tracks.center[last[a], None, :2], axis=-1)
        k, j = np.nonzero(off <= reach[a, None])
        yield a[k], in_time[low + j], last[a[k]]


def _overlapping(tracks: Tracks, first: Rows, last: Rows) -> Iterator[tuple[Rows, Rows, Rows]]:
    """Yield pairs of tracks (P,) of which the second begins in the first one's box, which ends in its own; and rows.

    These are the first one's when the second begins.
    """
    begins = np.zeros(len(tracks.track), np.bool_)
    begins[first] = True
    for rows in tracks.rows_by_scan(int(tracks.scan.max(initial=-1)) + 1):
        new, old = rows[begins[rows]], rows[~begins[rows]]
        k, j = np.nonzero(lies_within(tracks[new[:, None]], tracks[old]))
        a, b, row = tracks.track[old[j]], tracks.track[new[k]], old[j]
        after = tracks.scan[last[a]] - tracks.scan[row]
        goes_on = np.flatnonzero(after < last[b] - first[b])
        a, b, row, after = a[goes_on], b[goes_on], row[goes_on], after[goes_on]
        at, there = last[a], first[b] + after
        apart = np.hypot(*(tracks.center[there] - tracks.center[at])[:, :2].T)
        is_there = apart <= 0.5 * (tracks.size[at, 0] + tracks.size[there, 0])
        yield a[is_there], b[is_there], row[is_there]


def _link_score(
    tracks: Tracks,
    last: Rows,
    first: Rows,
    gap: Array,
    variance: Array | None = None,
    is_end: bool = False,
    stands: Mask | bool = False,
) -> Array:
    """Return (K,) the log-likelihood ratio of one body against two: ends at rows `last`, beginnings at `first`.

    variance : (R,) (m/s)^2 of the rows' velocities; they are known where it is not given.
    is_end : whether the places are those of a body's end, which does not depend on how much of it is seen.
    stands : (K,) whether neither moves: what stands goes on where it was.
    """
    offset = tracks.center[first] - tracks.center[last]
    v0, v1 = tracks.velocity[last, :2], tracks.velocity[first, :2]
    s0, s1 = (0.0 * gap if variance is None else variance[rows] for rows in (last, first))
    # The mean of both velocities carries a body over the gap; half of the gap's acceleration is free at either end.
    change = ACCELERATION**2 * (gap + 1.0)
    either = s0 + s1 + change
    weight = ((s1 + 0.5 * change) / either)[:, None]
    off = offset[:, :2] - gap[:, None] * (weight * v0 + (1.0 - weight) * v1)
    of_mean = (s0 * s1 + 0.25 * (s0 + s1) * change) / either
    # The centre of a part may be anywhere in the whole.
    shorter, longer = np.sort([tracks.size[rows, :2].max(axis=1) for rows in (last, first)], axis=0)
    extent = 0.0 if is_end else (0.25 * shorter) ** 2 + (longer - shorter) ** 2 / 12.0
    place = NOISE**2 + extent + np.where(stands, 0.0, ACCELERATION**2 * gap**3 / 12.0 + gap**2 * of_mean)
    squared = (off**2).sum(axis=1) / place + ((v1 - v0) ** 2).sum(axis=1) / either
    before, after = (np.sort(np.maximum(tracks.size[rows], LEAST_SIDE), axis=1) for rows in (last, first))
    growth = np.abs(np.log(before / after)).max(axis=1)
    density = -0.5 * squared - np.log(2.0 * np.pi * place) - np.log(2.0 * np.pi * either) - growth**2
    is_possible = (squared < 2.0 * REACH**2) & (np.abs(offset[:, 2]) < tracks.size[last, 2] + NOISE)
    return np.where(is_possible, density - np.log(BIRTHS), -np.inf)


def joined(tracks: Tracks, owner: Rows, ends: Rows, beginnings: Rows, n_points: Array) -> tuple[Tracks, Tracks]:
    """Return the rows of bodies, in every scan from their first to their last one, and those of all their parts.

    owner : (R,) from `parts_of_bodies`.   ends, beginnings : (K,) from `links_in_time`.
    n_points : (R,) of the segment of each row, which decides which part is the body's main one in a scan.
    """
    n = len(tracks)
    _, body = connected_components(coo_array((np.ones(len(ends)), (ends, beginnings)), shape=(n, n)), directed=False)
    _, body = np.unique(body[owner], return_inverse=True)
    order = np.lexsort((-n_points, owner != tracks.track, ~tracks.is_observed, tracks.scan, body))
    rows = replace(tracks, track=body)[order]
    is_first = (np.diff(rows.track, prepend=-1) > 0) | (np.diff(rows.scan, prepend=-1) != 0)
    return without_gaps(rows[np.flatnonzero(is_first)]), observed(rows)
