"""Parts: which tracklets are pieces of a moving body.

Two solid bodies are never in one place. So a tracklet that lies within a moving body's box in most of its scans is a
part of it: a wheel, the edge of a roof. So is what goes with it beside it, as a mirror; of a body that stands, nobody
can tell that. So is what lies where the body must be, shortly before it is first followed and after it is last. Where
it stands then, all that stays there is its own, as long as something is seen there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from automos.core.scan import Mask
from automos.objects.motion import ACCELERATION, NOISE
from automos.objects.tracks import Tracks, counted

Rows = npt.NDArray[np.int64]
BESIDE = 0.3  # metres around a body's box in which its parts lie
LONGEST = 5.0  # seconds out of sight after which a body is another


def parts_of_bodies(tracks: Tracks, is_moving: Mask, is_sure: Mask, weight: npt.NDArray, times: npt.NDArray) -> Rows:
    """Return (R,) for each row the track that it is a part of: its own, or a heavier moving one whose box it lies in.

    What stays where a body that `is_sure` to have moved stands before or after it is followed may be heavier.

    tracks : whole boxes of the moving ones.   is_moving, is_sure, weight : (T,), the last is points over life.
    times : (N,) seconds of the scans.
    """
    bodies = _with_foretold(tracks[np.flatnonzero(is_moving[tracks.track])], times)
    rows, body_rows = _enclosed(tracks, bodies)
    lighter = weight[tracks.track[rows]] < weight[bodies.track[body_rows]]
    rows, body_rows = rows[lighter], body_rows[lighter]
    is_inside = lies_within(tracks[rows], bodies[body_rows], NOISE)
    part, body = tracks.track[rows], bodies.track[body_rows]
    pairs, begin, n_scans = _grouped(part, body)
    end = begin + n_scans - 1
    way = bodies.center[body_rows[end]] - bodies.center[body_rows[begin]]
    apart = np.linalg.norm(tracks.center[rows[end]] - tracks.center[rows[begin]] - way, axis=1)
    way = np.linalg.norm(way, axis=1)
    goes_with = (way > BESIDE) & (apart <= np.maximum(0.5 * way, BESIDE))
    n_scans = np.where(goes_with, n_scans, np.add.reduceat(is_inside, begin, dtype=np.int64))
    share = n_scans / np.bincount(tracks.track[tracks.is_observed], minlength=len(tracks))[pairs[:, 0]]
    owner = np.arange(len(tracks))
    for k in np.argsort(share, kind="stable"):  # the greatest share comes last and remains
        if share[k] >= 0.5:
            owner[pairs[k, 0]] = pairs[k, 1]
    rest, of_rest = _at_rest(tracks, is_moving, is_sure, times)
    is_free = owner[rest] == rest
    owner[rest[is_free]] = of_rest[is_free]
    root = owner.copy()
    while not np.array_equal(root, root[root]):  # ends, as each owner moves, and is heavier than what moves
        root = root[root]
    is_theirs = np.isin(tracks.track, rest[is_free])
    is_theirs[rows[owner[part] == body]] = True
    return np.where(is_theirs, root[tracks.track], tracks.track)


def _at_rest(tracks: Tracks, is_moving: Mask, is_sure: Mask, times: npt.NDArray) -> tuple[Rows, Rows]:
    """Return the tracks (K,) that stay where another one stands at its end or beginning, after or before; and those.

    Of several, what stands there last before, or first after, comes last.
    """
    first, n = tracks.first_rows(), np.bincount(tracks.track, minlength=len(tracks))
    middle, last = first + n // 2, first + n - 1
    stays = np.flatnonzero(~is_moving)
    gone = np.linalg.norm(tracks.center[last] - tracks.center[first], axis=1)
    stands = is_sure & np.stack([np.hypot(*tracks.velocity[ends, :2].T) < 3.0 * NOISE for ends in (first, last)])
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))]
    tree = cKDTree(tracks.center[middle[stays], :2])
    for ends, their, step, is_standing in ((first, last, -1, stands[0]), (last, first, 1, stands[1])):
        body = np.flatnonzero(is_standing)
        reach = 0.5 * np.hypot(*tracks.size[ends[body], :2].T) + NOISE
        near = tree.query_ball_point(tracks.center[ends[body], :2], reach)
        body = np.repeat(body, [len(some) for some in near])
        part = stays[np.fromiter((k for some in near for k in some), np.int64, len(body))]
        wait = step * (times[tracks.scan[their[part]]] - times[tracks.scan[ends[body]]])
        is_there = lies_within(tracks[middle[part]], tracks[ends[body]], NOISE) & (wait <= LONGEST)
        is_there &= step * (tracks.scan[middle[part]] - tracks.scan[ends[body]]) > 0
        is_there &= gone[part] <= 0.5 * tracks.size[ends[body], 1]
        found.append((part[is_there], body[is_there], wait[is_there]))
    part, body, wait = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(-wait, kind="stable")
    return part[order], body[order]


def _with_foretold(bodies: Tracks, times: npt.NDArray) -> Tracks:
    """Return `bodies` and, behind them, their boxes before the first and after the last scan of each.

    For as long as the standard deviation of a body's place, if its acceleration is free, is below half of its width:
    what is left of it to see then is too little to be followed by itself.
    """
    first = np.flatnonzero(np.diff(bodies.track, prepend=-1))
    last = np.append(first[1:], len(bodies.track))[: len(first)] - 1
    found = [bodies]
    for ends, step in ((first, -1), (last, 1)):
        t, half_width = times[bodies.scan[ends]], 0.5 * bodies.size[ends, :2].min(axis=1)
        until = t + step * np.cbrt(3.0 * (half_width / ACCELERATION) ** 2)
        scan = np.searchsorted(times, until, "right" if step > 0 else "left") - (step > 0)
        n = np.maximum(step * (scan - bodies.scan[ends]), 0)
        row = np.repeat(ends, n)
        scan = bodies.scan[row] + step * counted(n)
        center = bodies.center[row] + bodies.velocity[row] * (times[scan] - times[bodies.scan[row]])[:, None]
        found.append(replace(bodies[row], scan=scan, segment=np.full(len(row), -1), center=center))
    return Tracks(*map(np.concatenate, zip(*(some.to_arrays().values() for some in found), strict=True)))


def _enclosed(tracks: Tracks, bodies: Tracks) -> tuple[Rows, Rows]:
    """Return the observed rows (P,) in another one's box of `bodies` in their scan, and its rows, by pair and scan."""
    found: list[tuple[Rows, Rows]] = [(np.zeros(0, np.int64),) * 2]
    n = 1 + int(max(tracks.scan.max(initial=-1), bodies.scan.max(initial=-1)))
    for here, there in zip(tracks.rows_by_scan(n), bodies.rows_by_scan(n), strict=True):
        k, j = np.nonzero(lies_within(tracks[here[:, None]], bodies[there]))
        found.append((here[k], there[j]))
    rows, body_rows = (np.concatenate(column) for column in zip(*found, strict=True))
    is_other = tracks.is_observed[rows] & (tracks.track[rows] != bodies.track[body_rows])
    rows, body_rows = rows[is_other], body_rows[is_other]
    order = np.lexsort((tracks.scan[rows], bodies.track[body_rows], tracks.track[rows]))
    return rows[order], body_rows[order]


def _grouped(a: Rows, b: Rows) -> tuple[Rows, Rows, Rows]:
    """Return the distinct pairs (K, 2) of sorted `a` and `b` (P,), where each begins, and how often it occurs."""
    begin = np.flatnonzero((np.diff(a, prepend=-1) != 0) | (np.diff(b, prepend=-1) != 0))
    return np.stack([a[begin], b[begin]], axis=1), begin, np.diff(np.append(begin, len(a)))


def lies_within(tracks: Tracks, bodies: Tracks, beside: float = BESIDE) -> Mask:
    """Return (...) whether the centre of each of `tracks` is within the box of the one of `bodies`; columns broadcast.

    Of height it is enough that both boxes touch: a body that rolls does not float.
    """
    x, y, z = np.moveaxis(tracks.center - bodies.center, -1, 0)
    c, s = np.cos(bodies.yaw), np.sin(bodies.yaw)
    along = np.abs(c * x + s * y) - 0.5 * bodies.size[..., 0]
    across = np.abs(c * y - s * x) - 0.5 * bodies.size[..., 1]
    above = np.abs(z) - 0.5 * (tracks.size[..., 2] + bodies.size[..., 2])
    return np.maximum(np.maximum(along, across), above) <= beside
