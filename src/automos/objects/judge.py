"""Whether a body has moved, and in which scans it moves: what each scan says, and the states that follow.

The chain of `states` has two readings, and each its log-likelihoods. Of *moved at some time* a scan says

    body + evidence - pieces - porosity - unsteadiness

All but the last are the segments' own (`terms`). While a mover waits its place is known to the centimetre; the scans in
which it comes or leaves outweigh those, as a chain has both.

*Unsteadiness*: what stands on the ground keeps the height of its bottom or top; segments of trees and walls do not.

*Way*: a net displacement of many standard deviations speaks for motion whatever the points say (`path_terms`).

*Lost hits*: of what stands, as many points have stayed as a moment ago. Of what sets off fewer have, long before it has
left its place, which at a lag speaks for motion (`lost_hits`).

*Moves now* follows from the velocity of the body's box (`moving_now`).

Scans within a look are not independent and count by the time between them. What stood and left is met by other rays, so
a car's length of its way says as much as a second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import expit, logit

from automos.core.column_data import ColumnData
from automos.core.scan import Mask
from automos.objects.face_paths import path_terms, way_beyond
from automos.objects.kinds import EXTENT, Kind
from automos.objects.looks import LOOK, looks, share_first_looks
from automos.objects.motion import ACCELERATION, AROUND, NOISE
from automos.objects.states import later, state_probabilities
from automos.objects.terms import CHANCE, Segments, SegmentTerms, doubted, log_ratio_of_shares
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts

Array = npt.NDArray[np.float64]

BEGIN, END = 0.003, 0.02  # changes of state per second
UNSTEADY = -0.8  # log-odds of moving per look, per unit of the heights' unsteadiness
DISPLACED, LEFT = 0.9, -2.3  # log-odds of a way: per factor e of it over its standard deviation, and of none
CHANGE = 0.1  # per second, rates at which movers set off and come to rest


@dataclass(frozen=True, eq=False)
class Past(ColumnData):
    """What scans that are forgotten said of T tracks.

    Attributes
    ----------
    stamp : (T,) float64, seconds of the last of them; -inf if there is none.
    p_moving, p_ever : (T,) float64, probabilities of moving at that time and of having moved by then.
    """

    stamp: Array
    p_moving: Array
    p_ever: Array

    @staticmethod
    def nothing(n: int) -> Past:
        """Return the past of `n` tracks of which nothing is known."""
        return Past(np.full(n, -np.inf), np.zeros(n), np.zeros(n))

    def before(self, first: npt.NDArray[np.int64], times: Array) -> tuple[Array, Array]:
        """Return both probabilities at the first of the observations (R,) of each track, before it."""
        is_seen = np.diff(first) > 0
        wait = np.where(is_seen, np.append(times, np.nan)[first[:-1]] - self.stamp, 0.0)
        return later(self.p_moving, self.p_ever, wait, BEGIN, END)


def judge_tracks(tracks: Tracks, segments: Segments, stamps: Array, past: Past | None = None) -> Verdicts:
    """Return moving for every track that has moved more likely than not.

    The confidence is the probability that the verdict is right. Tracks with a single observation are static, because
    the probabilities hold for what was observed twice.

    Parameters
    ----------
    segments : Segments of all scans.
    stamps : (N,) float64, seconds.
    past : of each track, if they are judged while more scans come: that it has gone no way yet does not count.
    """
    known = Past.nothing(len(tracks)) if past is None else past
    first, times, said = _observed(tracks, segments, stamps)
    ratio, scatter, displaced = _weighted(first, times, said, known)
    _, p_ever = state_probabilities(first, times, ratio, *known.before(first, times), BEGIN, END)
    more = DISPLACED * displaced + LEFT
    if past is not None:  # what has not gone far may still go, and scenery slides as it comes into sight
        more = np.clip(more, 0.0, -LEFT) + lost_hits(first, times, said)
    p_ever = expit(logit(p_ever) + more + DISPLACED * way_beyond(first, times, said.ends, said.sensor))
    p_ever[(np.diff(first) < 2) & np.isinf(known.stamp)] = 0.0
    is_moving = p_ever >= 0.5
    verdict = np.where(is_moving, Verdict.MOVING, Verdict.STATIC).astype(np.int8)
    return Verdicts(verdict, np.where(is_moving, p_ever, 1.0 - p_ever), scatter)


def past_of(tracks: Tracks, segments: Segments, stamps: Array, past: Past, is_over: Mask) -> Past:
    """Return the `past` of tracks once the scans `is_over` (N,), the first ones, belong to it; see `judge_tracks`."""
    first, times, said = _observed(tracks, segments, stamps)
    ratio, *_ = _weighted(first, times, said, past)
    over = np.concatenate([[0], np.cumsum(is_over[tracks.scan[tracks.is_observed]])])[first]
    rows = np.flatnonzero(is_over[tracks.scan[tracks.is_observed]])
    times, ratio = times[rows], ratio[rows]
    p_moving, p_ever = state_probabilities(over, times, ratio, *past.before(over, times), BEGIN, END)
    is_known, last = np.diff(over) > 0, over[1:] - 1
    stamp, p_moving = (np.append(of_rows, np.nan)[last] for of_rows in (times, p_moving))
    before = past.stamp, past.p_moving, past.p_ever
    return Past(*(np.where(is_known, *both) for both in zip((stamp, p_moving, p_ever), before, strict=True)))


def _observed(tracks: Tracks, segments: Segments, stamps: Array) -> tuple[npt.NDArray[np.int64], Array, SegmentTerms]:
    """Return the first observation of each track (T + 1,), the times (R,) of all, and what their segments say (R,)."""
    seen = np.flatnonzero(tracks.is_observed)
    first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
    return first, stamps[tracks.scan[seen]], segments.terms[segments.of(tracks)[seen]]


def _weighted(first: npt.NDArray[np.int64], times: Array, said: SegmentTerms, past: Past) -> tuple[Array, Array, Array]:
    """Return the log-likelihood ratios (R,) of all observations; and (T,) each: scatter, metres, and term of the way.

    See `path_terms` for these.
    """
    scatter, unsteady, displaced, gone = path_terms(first, times, said.faces)
    ratio = said.evidence + np.repeat(UNSTEADY * unsteady, np.diff(first))
    worth = looks(first, times, since=past.stamp)
    share_first_looks(worth, first, times, np.isinf(past.stamp))
    worth *= 1.0 + np.where(_has_stood(first, gone), gone, 0.0) / EXTENT[Kind.CAR, 0]
    return ratio * worth, scatter, displaced


def _has_stood(first: npt.NDArray[np.int64], gone: Array) -> Mask:
    """Return (R,) whether a track stood at that observation or before; it goes `gone` (R,), metres, in a second."""
    n_stood = np.cumsum(gone < 2.0 * NOISE)
    return n_stood > np.repeat(np.append(0, n_stood)[first[:-1]], np.diff(first))


def lost_hits(first: npt.NDArray[np.int64], times: Array, said: SegmentTerms) -> Array:
    """Return (T,) the log-likelihood ratio of the last sight of each track: it sets off, against it stands as before.

    Before are its whole segments of the last look, without the last moment, three at least, of which most stayed. From
    elsewhere other rays meet a thing: per metre that the sensor has gone, up to one, a tenth of looks has any shares.
    Only what speaks for motion counts, as of the way: a body within its own length of its place seems to stay there.

    first : (T + 1,) the first observation of each track.   times : (R,) seconds.

    Equation: lost
    """
    track, last = np.repeat(np.arange(len(first) - 1), np.diff(first)), first[1:] - 1
    age = times[last[track]] - times
    is_whole, counts = said.part_of < 0, said.counts.astype(np.float64)
    is_before = is_whole & (age > 0.5 * AROUND) & (age <= LOOK)
    away = np.linalg.norm(said.sensor - said.sensor[last[track]], axis=1)
    n = np.bincount(track, is_before, len(last))
    sums = (np.bincount(track, is_before * column, len(last)) for column in (away, *(counts[:, 1:] / counts[:, :1]).T))
    away, moved, stayed = (total / np.maximum(n, 1.0) for total in sums)
    is_known = (n > 2.0) & (stayed > 0.5)
    at = last[is_known]
    is_known[is_known] = is_whole[at] & said.is_asked[at] & (counts[at, 0] >= 16.0)  # of few, shares say little
    chance = np.clip(expit(LEFT) * away, CHANCE, expit(LEFT))[is_known]
    before = np.stack([moved, stayed], axis=-1)[is_known]
    out = np.zeros(len(last))
    out[is_known] = np.clip(log_ratio_of_shares(counts[last[is_known], 1:], before, chance), 0.0, -LEFT)
    return out


def moving_now(tracks: Tracks, verdicts: Verdicts, stamps: Array) -> Tracks:
    """Return `tracks` with the probability of moving in every scan, from the smoothed velocities of their boxes.

    While a body stands its velocity is zero up to the noise of the smoother, or of its own sights where these scatter
    less, as a near person's do. That of a mover has heavy tails, about what it has a second after it set off, as later
    nothing is in doubt. Velocities within the smoother's time constant, before and after, are one. What has moved with
    probability p moves at a scan with p times the probability that follows.
    """
    first = np.searchsorted(tracks.track, np.arange(len(tracks) + 1))
    squared = (tracks.velocity[:, :2] ** 2).sum(axis=1)
    moves = -1.5 * np.log1p(squared / ACCELERATION**2) - 2.0 * np.log(ACCELERATION)  # Cauchy in the plane
    noise = np.fmin(verdicts.scatter, NOISE)[tracks.track]  # metres, over a second
    stands = -0.5 * squared / noise**2 - 2.0 * np.log(noise)
    times = stamps[tracks.scan]
    ratio = doubted(moves - stands, CHANCE) * looks(first, times, 2.0 * np.sqrt(NOISE / ACCELERATION))
    even = np.full(len(tracks), 0.5)
    p_moving, _ = state_probabilities(first, times, ratio, even, even, CHANGE, CHANGE)
    p_ever = np.where(verdicts.is_moving, verdicts.confidence, 1.0 - verdicts.confidence)
    return replace(tracks, p_moving=p_moving * p_ever[tracks.track])


def is_scenery(tracks: Tracks, is_moving: Mask, segments: Segments) -> Mask:
    """Return (T,) which tracks do not move and have stayed in every scan, by the evidence on their segments alone."""
    has_stayed = np.append(segments.terms.has_stayed, True)[segments.of(tracks)]
    return (np.bincount(tracks.track, ~has_stayed, len(tracks)) == 0) & ~is_moving
