"""Whether a body has moved, and in which scans it moves: what each scan says, and the states that follow.

The chain of `states` has two readings, and each its log-likelihoods. Of *moved at some time* a scan says

    body + evidence - pieces - porosity - unsteadiness

*Evidence*: the points of a scan are correlated, so the numbers of moved, stayed and unknown ones follow a
Dirichlet-multinomial distribution in either state. Where poses are off it is wrong, so it is a mixture with its own
opposite, which bounds what one look can say. While a mover waits its place is known to the centimetre; the scans in
which it comes or leaves outweigh those, as a chain has both.

*Body*: pieces that the evidence cut out of a segment are seldom objects. The face of a vehicle or a person returns all
rays that meet it; rain, dust, spray and leaves let rays through. On a square face of n rays, the share 1 - 1.5 /
sqrt(n) + 0.5 / n of the neighbours of a ray are on the face, too; porosity is the missing part of that share. What
stands on the ground keeps the height of its bottom or top; segments of trees and walls do not.

*Way*: a net displacement of many standard deviations speaks for motion whatever the points say (`path_terms`).

*Moves now* follows from the velocity of the body's box (`moving_now`).

Scans within a look are not independent and count by the time between them.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import expit, gammaln, logit

from automos.core.column_data import ColumnData
from automos.core.scan import Mask
from automos.objects.detections import Detections
from automos.objects.face_paths import path_terms
from automos.objects.looks import looks, share_first_looks
from automos.objects.motion import NOISE
from automos.objects.states import later, state_probabilities
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts

Array = npt.NDArray[np.float64]

MOVED, STAYED = (1.02, 0.49, 0.455), (0.18, 0.98, 0.455)
"""Dirichlet distributions of the shares of moved, stayed and unknown points in a scan: of a mover in motion, and of a
static object."""
WRONG = 0.001  # share of looks in which the evidence is that of the other state
BEGIN, END = 0.003, 0.02  # changes of state per second
BODY, PIECE, POROUS, UNSTEADY = 1.8, -3.2, -0.5, -0.8  # log-odds of moving per look: of all, and per unit of a term
LEAST_SOLID = 0.1  # lower limit of solidity relative to that of a solid face
DISPLACED, LEFT = 0.9, -2.3  # log-odds of a way: per factor e of it over its standard deviation, and of none
SPEED = 5.0  # m/s, scale of the velocities of movers
JUMPS = 0.01  # share of looks in which a body's box says the opposite: it is cut or joined with another
CHANGE = 0.1  # per second, rates at which movers set off and come to rest


@dataclass(frozen=True, eq=False)
class SegmentTerms(ColumnData):
    """The terms of the M segments of one scan for the tracks they belong to.

    Attributes
    ----------
    faces : (M, 4) float64, metres: the centre along x and y, and the heights of the lower and of the upper face.
    evidence : (M,) float64, log-likelihood ratio of the points, moved against stayed, plus that of being a body.
    """

    faces: Array
    evidence: Array


def segment_terms(found: Detections, is_asked: bool = True) -> SegmentTerms:
    """Return the terms of the segments of a scan.

    Unknown points count as evidence only if scans a second or more away were asked (`is_asked`); else segments of
    which nothing is known say nothing.

    Equations: counts, doubt
    """
    # Relative deficit of solidity from a face of as many rays.
    n = np.maximum(found.n_points, 2.0)
    porosity = np.clip(1.0 - found.solidity / (1.0 - 1.5 / np.sqrt(n) + 0.5 / n), 0.0, 1.0)
    of_bodies = PIECE * (found.part_of >= 0) + POROUS * porosity / np.maximum(1.0 - porosity, LEAST_SOLID)
    x, y, z = found.boxes.center.T
    half = 0.5 * found.boxes.size[:, 2]
    says = is_asked | (found.n_moving + found.n_static > 0.0)
    evidence = says * (BODY + of_bodies + _doubted(_evidence(found, is_asked), WRONG))
    return SegmentTerms(np.stack([x, y, z - half, z + half], axis=-1), evidence)


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


def judge_tracks(tracks: Tracks, terms: Sequence[SegmentTerms], stamps: Array, past: Past | None = None) -> Verdicts:
    """Return moving for every track that has moved more likely than not.

    The confidence is the probability that the verdict is right. Tracks with a single observation are static, because
    the probabilities hold for what was observed twice.

    Parameters
    ----------
    terms : sequence of SegmentTerms, one per scan.
    stamps : (N,) float64, seconds.
    past : of each track, if they are judged while more scans come: those of the first look share it, and the way does
        not count, as it is not over.
    """
    known = Past.nothing(len(tracks)) if past is None else past
    first, times, ratio, scatter, displaced = _weighted(tracks, terms, stamps, known, past is not None)
    _, p_ever = state_probabilities(first, times, ratio, *known.before(first, times), BEGIN, END)
    if past is None:
        p_ever = expit(logit(p_ever) + DISPLACED * displaced + LEFT)
    p_ever[(np.diff(first) < 2) & np.isinf(known.stamp)] = 0.0
    is_moving = p_ever >= 0.5
    verdict = np.where(is_moving, Verdict.MOVING, Verdict.STATIC).astype(np.int8)
    return Verdicts(verdict, np.where(is_moving, p_ever, 1.0 - p_ever), scatter)


def past_of(tracks: Tracks, terms: Sequence[SegmentTerms], stamps: Array, past: Past, is_over: Mask) -> Past:
    """Return the `past` of tracks once the scans `is_over` (N,), the first ones, belong to it; see `judge_tracks`."""
    first, times, ratio, *_ = _weighted(tracks, terms, stamps, past, True)
    over = np.concatenate([[0], np.cumsum(is_over[tracks.scan[tracks.is_observed]])])[first]
    rows = np.flatnonzero(is_over[tracks.scan[tracks.is_observed]])
    times, ratio = times[rows], ratio[rows]
    p_moving, p_ever = state_probabilities(over, times, ratio, *past.before(over, times), BEGIN, END)
    is_known, last = np.diff(over) > 0, over[1:] - 1
    stamp, p_moving = (np.append(of_rows, np.nan)[last] for of_rows in (times, p_moving))
    before = past.stamp, past.p_moving, past.p_ever
    return Past(*(np.where(is_known, *both) for both in zip((stamp, p_moving, p_ever), before, strict=True)))


def _weighted(
    tracks: Tracks, terms: Sequence[SegmentTerms], stamps: Array, past: Past, is_going_on: bool
) -> tuple[npt.NDArray[np.int64], Array, Array, Array, Array]:
    """Return the first observation of each track (T + 1,), times (R,) and log-likelihood ratios (R,) of all.

    Fourth and fifth are (T,) the scatter of each track, metres, and the term of its way; see `path_terms`.
    """
    seen = np.flatnonzero(tracks.is_observed)
    first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
    times = stamps[tracks.scan[seen]]
    every = SegmentTerms.concatenate([SegmentTerms(np.zeros((0, 4)), np.zeros(0)), *terms])
    of_rows = every[_segments(tracks, seen, terms)]
    scatter, unsteady, displaced = path_terms(first, times, of_rows.faces)
    ratio = of_rows.evidence + np.repeat(UNSTEADY * unsteady, np.diff(first))
    worth = looks(first, times, since=past.stamp)
    if is_going_on:
        share_first_looks(worth, first, times, np.isinf(past.stamp))
    return first, times, ratio * worth, scatter, displaced


def moving_now(tracks: Tracks, verdicts: Verdicts, stamps: Array) -> Tracks:
    """Return `tracks` with the probability of moving in every scan, from the smoothed velocities of their boxes.

    While a body stands its velocity is zero up to the noise of the smoother, and that of a mover has heavy tails. A
    body that has moved with probability p moves at a scan with p times the probability that follows.
    """
    first = np.searchsorted(tracks.track, np.arange(len(tracks) + 1))
    squared = (tracks.velocity[:, :2] ** 2).sum(axis=1)
    moves = -1.5 * np.log1p(squared / SPEED**2) - 2.0 * np.log(SPEED)  # Cauchy in the plane
    stands = -0.5 * squared / NOISE**2 - 2.0 * np.log(NOISE)  # NOISE over a second
    times = stamps[tracks.scan]
    ratio = _doubted(moves - stands, JUMPS) * looks(first, times, 1.0)
    even = np.full(len(tracks), 0.5)
    p_moving, _ = state_probabilities(first, times, ratio, even, even, CHANGE, CHANGE)
    p_ever = np.where(verdicts.is_moving, verdicts.confidence, 1.0 - verdicts.confidence)
    return replace(tracks, p_moving=p_moving * p_ever[tracks.track])


def is_scenery(tracks: Tracks, is_moving: Mask, has_stayed: Sequence[Mask]) -> Mask:
    """Return (T,) which tracks do not move and have stayed in every scan, as `has_stayed` says of its segments."""
    out, rows = np.ones(len(tracks), np.bool_), np.flatnonzero(tracks.is_observed)
    if len(rows):
        out[tracks.track[rows[~np.concatenate(has_stayed)[_segments(tracks, rows, has_stayed)]]]] = False
    return out & ~is_moving


def _doubted(log_ratio: Array, wrong: float) -> Array:
    """Return the log-likelihood ratio of two hypotheses, each of which looks as the other in a share `wrong`."""
    log_ratio = np.clip(log_ratio, -100.0, 100.0)
    sure, doubt = np.log1p(-wrong), np.log(wrong)
    return np.logaddexp(sure + log_ratio, doubt) - np.logaddexp(sure, doubt + log_ratio)


def _evidence(found: Detections, is_asked: bool) -> Array:
    """Return (M,) the log-likelihood ratio of each segment, moved against stayed, from the counts of its points."""
    known = found.n_moving + found.n_static
    unknown = np.maximum(found.n_points - known, 0.0)
    counts = np.stack([found.n_moving, found.n_static, unknown][: 3 if is_asked else 2], axis=-1)
    return _log_dirichlet(counts, MOVED) - _log_dirichlet(counts, STAYED)


def _log_dirichlet(counts: Array, distribution: tuple[float, ...]) -> Array:
    """Return (M,) the log-likelihood of `counts` (M, C) under the first C parameters of the Dirichlet distribution."""
    prior = np.array(distribution[: counts.shape[1]])
    total = gammaln(prior.sum()) - gammaln(prior.sum() + counts.sum(axis=1))
    return total + (gammaln(prior + counts) - gammaln(prior)).sum(axis=1)


def _segments(tracks: Tracks, seen: npt.NDArray[np.int64], per_scan: Sequence[Sized]) -> npt.NDArray[np.int64]:
    """Return (K,) the segment of each of the rows `seen` (K,), numbered through all scans."""
    begins = np.cumsum([0, *(len(of_scan) for of_scan in per_scan)])
    return begins[tracks.scan[seen]] + tracks.segment[seen]
