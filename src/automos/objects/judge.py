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
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.special import expit, gammaln, logit

from automos.core.column_data import ColumnData
from automos.core.scan import Mask
from automos.objects.detections import Detections
from automos.objects.motion import NOISE, smooth_paths
from automos.objects.states import state_probabilities
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts

Array = npt.NDArray[np.float64]

MOVED, STAYED = (1.02, 0.49, 0.455), (0.18, 0.98, 0.455)
"""Dirichlet distributions of the shares of moved, stayed and unknown points in a scan: of a mover in motion, and of a
static object."""
LOOK = 1.7  # seconds within which scans say the same
WRONG = 0.001  # share of looks in which the evidence is that of the other state
START, BEGIN, END = 0.12, 0.003, 0.02  # probability of motion in the first scan; changes of state per second
BODY, PIECE, POROUS, UNSTEADY = 1.8, -3.2, -0.5, -0.8  # log-odds of moving per look: of all, and per unit of a term
LEAST_SOLID = 0.1  # lower limit of solidity relative to that of a solid face
LEAST_SCATTER = 0.05  # metres, of the faces of a box
DISPLACED, LEFT = 0.9, -2.6  # log-odds of a way: per factor e of it over its standard deviation, and of none
SPEED = 5.0  # m/s, scale of the velocities of movers
JUMPS = 0.05  # share of looks in which a body's box says the opposite: it is cut or joined with another
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

    Unknown points count as evidence only if scans a second or more away were asked (`is_asked`).

    Equations: counts, doubt
    """
    # Relative deficit of solidity from a face of as many rays.
    n = np.maximum(found.n_points, 2.0)
    porosity = np.clip(1.0 - found.solidity / (1.0 - 1.5 / np.sqrt(n) + 0.5 / n), 0.0, 1.0)
    of_bodies = PIECE * (found.part_of >= 0) + POROUS * porosity / np.maximum(1.0 - porosity, LEAST_SOLID)
    x, y, z = found.boxes.center.T
    half = 0.5 * found.boxes.size[:, 2]
    evidence = BODY + of_bodies + _doubted(_evidence(found, is_asked), WRONG)
    return SegmentTerms(np.stack([x, y, z - half, z + half], axis=-1), evidence)


def judge_tracks(tracks: Tracks, terms: Sequence[SegmentTerms], stamps: Array, is_going_on: bool = False) -> Verdicts:
    """Return moving for every track that has moved more likely than not.

    The confidence is the probability that the verdict is right. Tracks with a single observation are static, because
    the probabilities hold for what was observed twice.

    Parameters
    ----------
    terms : sequence of SegmentTerms, one per scan.
    stamps : (N,) float64, seconds.
    is_going_on : whether tracks are judged while more scans come: those of the first look share it, and no way counts.
    """
    seen = np.flatnonzero(tracks.is_observed)
    first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
    n_seen, times = np.diff(first), stamps[tracks.scan[seen]]
    every = SegmentTerms.concatenate([SegmentTerms(np.zeros((0, 4)), np.zeros(0)), *terms])
    of_rows = every[_segments(tracks, seen, terms)]
    scatter, unsteady, displaced = path_terms(first, times, of_rows.faces)
    ratio = of_rows.evidence + np.repeat(UNSTEADY * unsteady, n_seen)
    worth = shared_looks(first, times) if is_going_on else looks(first, times)
    _, p_ever = state_probabilities(first, times, ratio * worth, START, BEGIN, END)
    if not is_going_on:  # else the way is not over
        p_ever = expit(logit(p_ever) + DISPLACED * displaced + LEFT)
    p_ever[n_seen < 2] = 0.0
    is_moving = p_ever >= 0.5
    verdict = np.where(is_moving, Verdict.MOVING, Verdict.STATIC).astype(np.int8)
    return Verdicts(verdict, np.where(is_moving, p_ever, 1.0 - p_ever), scatter)


def path_terms(first: npt.NDArray[np.int64], times: Array, faces: Array) -> tuple[Array, Array, Array]:
    """Return (T,) each: scatter of centres, metres, and two logarithms: of unsteady heights, and of a track's way.

    The way from first to last counts in standard deviations of the centres about their smoothed path, as segments of
    scenery slide and jump while they come into sight.

    first : (T + 1,) the first observation of each track.   times : (R,) seconds.   faces : (R, 4), see `SegmentTerms`.

    Equation: way
    """
    path, _, _ = smooth_paths(first, times, faces)
    begin, n = first[:-1], np.diff(first)
    track = np.repeat(np.arange(len(n)), n)
    squared = [np.bincount(track, column, len(n)) / np.maximum(n, 1) for column in ((faces - path) ** 2).T]
    unsteady = np.sqrt(np.minimum(squared[2], squared[3])) / LEAST_SCATTER
    way, is_there = np.zeros(len(n)), n > 0
    way[is_there] = np.linalg.norm((path[first[1:][is_there] - 1] - path[begin[is_there]])[:, :2], axis=1)
    scatter = np.sqrt(squared[0] + squared[1]) + LEAST_SCATTER
    return scatter, np.log1p(unsteady), np.log1p(way * np.sqrt(n) / scatter)


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
    p_moving, _ = state_probabilities(first, times, ratio, 0.5, CHANGE, CHANGE)
    p_ever = np.where(verdicts.is_moving, verdicts.confidence, 1.0 - verdicts.confidence)
    return replace(tracks, p_moving=p_moving * p_ever[tracks.track])


def looks(first: npt.NDArray[np.int64], times: Array, look: float = LOOK) -> Array:
    """Return (R,) the looks that each observation is worth: 1 for a track's first, then the time since the one before.

    first : (T + 1,) the first observation of each track.   times : (R,) seconds.
    """
    worth = np.minimum(np.diff(times, prepend=times[:1]) / look, 1.0)
    worth[first[:-1][np.diff(first) > 0]] = 1.0
    return worth


def shared_looks(first: npt.NDArray[np.int64], times: Array) -> Array:
    """Return (R,) the same looks, those of the observations within a track's first one shared evenly among them.

    What has just come into sight is judged by all scans since, as later ones do not outweigh its first one yet.
    """
    worth = looks(first, times)
    for begin, end in pairwise(first):
        within = slice(begin, begin + np.searchsorted(times[begin:end], times[begin:end][:1].sum() + LOOK))
        worth[within] = worth[within].sum() / max(within.stop - begin, 1)
    return worth


def is_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> Mask:
    """Return (T,) which tracks have stayed in every scan and do not move."""
    out, rows = np.ones(len(tracks), np.bool_), np.flatnonzero(tracks.is_observed)
    if len(rows):
        has_stayed = np.concatenate([found.has_stayed for found in detections])
        out[tracks.track[rows[~has_stayed[_segments(tracks, rows, detections)]]]] = False
    return out & ~verdicts.is_moving


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
