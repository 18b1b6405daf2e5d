"""Whether a body moves: log-likelihoods of standing and of moving in every scan, and the states that follow.

The chain of `states` has two states. What a scan says of them is the sum of

*Evidence*: the points of a scan are correlated, so the numbers of moved, stayed and unknown ones follow a
Dirichlet-multinomial distribution in either state.

*Displacement*: while a body stands it keeps its place, so its velocity over a look is zero up to the noise of the
segments' faces; that of a mover has heavy tails (Cauchy). A static object of which more comes into sight extends at
one face only. So on each axis the smaller velocity of the two faces counts, if their signs agree.

*Body*: pieces that the evidence cut out of a segment are seldom objects. The face of a vehicle or a person returns all
rays that meet it; rain, dust, spray and leaves let rays through. On a square face of n rays, the share 1 - 1.5 /
sqrt(n) + 0.5 / n of the neighbours of a ray are on the face, too; porosity is the missing part of that share. What
stands on the ground keeps the height of its bottom or top; segments of trees and walls do not.

Evidence and displacement are both wrong at times: poses are off, segments jump. So each is a mixture with its own
opposite, which bounds what one look can say. Scans within a look are not independent and count by the time between.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from automos.core.column_data import ColumnData
from automos.core.scan import Mask
from automos.objects.detections import Detections
from automos.objects.face_paths import face_scatter, face_velocities
from automos.objects.states import chain_of_two
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts

Array = npt.NDArray[np.float64]

MOVED, STAYED = (1.02, 0.49, 0.455), (0.18, 0.98, 0.455)
"""Dirichlet distributions of the shares of moved, stayed and unknown points in a scan: of a mover in motion, and of a
static object."""
LOOK = 1.0  # seconds within which scans say the same
SPEED = 3.0  # m/s, scale of the velocities of movers
WRONG_EVIDENCE, WRONG_DISPLACEMENT = 0.05, 0.05  # shares of looks
BEGINS_MOVING, BEGIN, END = 0.3, 0.02, 0.2  # probability of moving in the first scan; changes of state per second
BODY, PIECE, POROUS, UNSTEADY = 0.0, -3.0, -3.0, 0.0  # log-odds of moving, per look: of all, and per unit of the terms
LEAST_SOLID = 0.1  # lower limit of solidity relative to that of a solid face
NOISE = 0.05  # metres, least scatter of a face of a box


@dataclass(frozen=True, eq=False)
class SegmentTerms(ColumnData):
    """The terms of the M segments of one scan for the tracks they belong to.

    Attributes
    ----------
    faces : (M, 6) float64, metres, x, y, z of the low and of the high faces.
    evidence : (M,) float64, log-likelihood ratio of the points, moved against stayed, plus that of being a body.
    """

    faces: Array
    evidence: Array


def segment_terms(found: Detections, is_asked: bool = True) -> SegmentTerms:
    """Return the terms of the segments of a scan.

    Unknown points count as evidence only if scans a second or more away were asked (`is_asked`).
    """
    boxes = found.boxes
    c, s = np.abs(np.cos(boxes.yaw)), np.abs(np.sin(boxes.yaw))
    length, width, height = boxes.size.T
    half = 0.5 * np.stack([c * length + s * width, s * length + c * width, height], axis=-1)
    # Relative deficit of solidity from a face of as many rays.
    n = np.maximum(found.n_points, 2.0)
    porosity = np.clip(1.0 - found.solidity / (1.0 - 1.5 / np.sqrt(n) + 0.5 / n), 0.0, 1.0)
    is_body = PIECE * (found.part_of >= 0) + POROUS * porosity / np.maximum(1.0 - porosity, LEAST_SOLID)
    evidence = _doubted(_evidence(found, is_asked), WRONG_EVIDENCE) + is_body
    return SegmentTerms(np.hstack([boxes.center - half, boxes.center + half]), evidence)


def judge_tracks(
    tracks: Tracks, terms: Sequence[SegmentTerms], stamps: Array, shifts: Array | None = None
) -> tuple[Tracks, Verdicts]:
    """Return `tracks` with the probability of moving in every scan, and the verdicts: moving if more likely than not.

    The confidence of a verdict is the probability that it is right. Tracks with a single observation are static.

    Parameters
    ----------
    terms : sequence of SegmentTerms, one per scan.
    stamps : (N,) float64, seconds.
    shifts : (N,) float64, optional, log-odds of moving added to those of observations in each scan.
    """
    p_moving, p_ever = np.zeros(len(tracks.track)), np.zeros(len(tracks))
    seen = np.flatnonzero(tracks.is_observed)
    if len(seen):
        first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
        times = stamps[tracks.scan[seen]]
        ratio = log_ratios(first, times, SegmentTerms.concatenate(list(terms))[_segments(tracks, seen, terms)])
        if shifts is not None:
            ratio += shifts[tracks.scan[seen]]
        p_moving[seen], p_ever = chain_of_two(first, times, ratio, BEGINS_MOVING, BEGIN, END)
        p_ever[np.diff(first) < 2] = 0.0
        unseen = np.flatnonzero(~tracks.is_observed)
        p_moving[unseen] = p_moving[seen[np.maximum(np.searchsorted(seen, unseen) - 1, 0)]]
    is_moving = p_ever >= 0.5
    verdict = np.where(is_moving, Verdict.MOVING, Verdict.STATIC).astype(np.int8)
    return replace(tracks, p_moving=p_moving), Verdicts(verdict, np.where(is_moving, p_ever, 1.0 - p_ever))


def log_ratios(first: npt.NDArray[np.int64], times: Array, terms: SegmentTerms) -> Array:
    """Return (R,) the log-likelihood ratio of moving against standing of each observation.

    first : (T + 1,) the first observation of each track.   times : (R,) seconds.   terms : of the R observations.
    """
    faces, length = terms.faces, np.diff(first)
    scatter = face_scatter(first, faces)
    steadier = np.minimum(scatter[:, 0] + scatter[:, 1], scatter[:, 3] + scatter[:, 4])
    noise = NOISE + np.sqrt(steadier)
    velocity, deviation = face_velocities(first, times, faces[:, 0:2], faces[:, 3:5], noise, LOOK)
    squared = (velocity**2).sum(axis=1)
    known = np.isfinite(deviation)
    deviation = np.where(known, deviation, 1.0)
    moves = -1.5 * np.log1p(squared / SPEED**2) - 2.0 * np.log(SPEED)
    stands = -0.5 * squared / deviation**2 - 2.0 * np.log(deviation)
    ratio = terms.evidence + np.where(known, _doubted(moves - stands, WRONG_DISPLACEMENT), 0.0) + BODY
    unsteady = UNSTEADY * np.log1p(np.sqrt(np.minimum(scatter[:, 2], scatter[:, 5])) / NOISE)
    since = np.diff(times, prepend=times[:1])
    since[first[:-1][length > 0]] = LOOK
    return (ratio + np.repeat(unsteady, length)) * np.minimum(since / LOOK, 1.0)


def without_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> tuple[Tracks, Verdicts]:
    """Return the tracks and their verdicts without those that have stayed in every scan and do not move."""
    is_kept = ~is_scenery(tracks, verdicts, detections)
    kept = tracks[is_kept[tracks.track]]
    return replace(kept, track=(np.cumsum(is_kept) - 1)[kept.track]), verdicts[is_kept]


def is_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> Mask:
    """Return (T,) which tracks have stayed in every scan and do not move."""
    out, rows = np.ones(len(tracks), np.bool_), np.flatnonzero(tracks.is_observed)
    if len(rows):
        has_stayed = np.concatenate([found.has_stayed for found in detections])
        out[tracks.track[rows[~has_stayed[_segments(tracks, rows, detections)]]]] = False
    return out & ~verdicts.is_moving


def _doubted(log_ratio: Array, wrong: float) -> Array:
    """Return the log-likelihood ratio of two hypotheses of which each holds as the other in a share `wrong` of looks."""
    log_ratio = np.clip(log_ratio, -100.0, 100.0)
    right, wrong = np.log1p(-wrong), np.log(wrong)
    return np.logaddexp(right + log_ratio, wrong) - np.logaddexp(right, wrong + log_ratio)


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
