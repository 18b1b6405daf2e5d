"""The verdict on a track: log-odds of having moved, from the evidence and its motion (the `default` preset).

    log odds(moved) = prior + evidence + displacement - unsteadiness - pieces - porosity

Each term is a weighted log-likelihood ratio, "it moved" against "it stayed"; weights and distributions were fitted
once, by maximum likelihood, on tracks of simulated worlds, so that the sum is calibrated.

*Evidence*: the points of a scan are correlated, so the numbers of moved, stayed and unknown ones follow a
Dirichlet-multinomial distribution under either hypothesis. A mover may stand for a while, so a single scan can hardly
speak against it. Scans of one place are correlated, too: their mean counts, as two observations. Where poses are off,
all evidence is wrong, so its weight is limited by the odds of that.

*Displacement*: a static object of which more comes into sight extends at one face only. So on each axis the smaller
displacement of the two faces counts, if their signs agree. The noise is the scatter of the steadier face about its own
path. It has heavy tails (Cauchy), because segments jump.

*Unsteadiness, pieces*: what stands on the ground keeps the height of its bottom or top from scan to scan; segments of
trees and walls do not. Pieces that the evidence cut out of a segment are seldom objects.

*Porosity*: the face of a vehicle or a person returns all rays that meet it; rain, dust, spray and leaves let rays
through. On a square face of n rays, the share 1 - 1.5 / sqrt(n) + 0.5 / n of the neighbours of a ray are on the face,
too; porosity is the missing part of that share. The term is the number of rays let through for each returned ray.
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
from automos.objects.face_paths import follow_faces
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.settings import JudgeSettings

Array = npt.NDArray[np.float64]

PRIOR = 1.60  # log-odds of a track of which nothing is known except that a segment was observed twice
WEIGHTS = {"evidence": 0.89, "displacement": 0.41, "unsteady": -0.92, "pieces": -3.82, "porous": -3.00}
"""Weights of the terms, fitted by `benchmarks/fit_judge.py` on simulated worlds, including rain and specks. The last
was fitted again beside the others: 2.4 without dust, 3.2 in dust only, 3.0 on all worlds."""
MOVED, STAYED = (1.02, 0.49, 0.455), (0.18, 0.98, 0.455)
"""Dirichlet distributions of the shares of moved, stayed and unknown points in a scan: of a mover in motion, and of a
static object."""
ENOUGH_KNOWN = 0.2  # share of known points that counts in full before other scans were asked; edges reach smaller ones
UNDER_WAY = 0.986  # share of a mover's scans in which the evidence shows that it moves
LOOKS = 2.2  # number of independent observations that all scans of a track are equivalent to
MISJUDGED = 0.03  # share of static objects whose evidence is wrong in all scans: poses are off, or they are thin
LEAST_SOLID = 0.02  # lower limit of solidity relative to that of a solid face
NOISE = 0.05  # metres, least scatter of a face of a tracked box


@dataclass(frozen=True, eq=False)
class SegmentTerms(ColumnData):
    """The terms of the M segments of one scan for the tracks they belong to.

    Attributes
    ----------
    faces : (M, 6) float64, metres, x, y, z of the low and of the high faces.
    means : (M, 3) float64, whose means over a track count: log-likelihood ratio of the points' evidence, moved against
        stayed; 1 for pieces of a segment; porosity in [0, 1].
    is_known : (M,) bool, segments with a known point, or all if other scans were asked.
    """

    faces: Array
    means: Array
    is_known: Mask


def segment_terms(found: Detections, is_asked: bool = True) -> SegmentTerms:
    """Return the terms of the segments of a scan.

    Unknown points count as evidence only if scans a second or more away were asked. Before that (`is_asked` is False)
    only the known points count, under the same distributions, and in full only if they are enough of the object.
    """
    boxes, known = found.boxes, found.n_moving + found.n_static
    c, s = np.abs(np.cos(boxes.yaw)), np.abs(np.sin(boxes.yaw))
    length, width, height = boxes.size.T
    half = 0.5 * np.stack([c * length + s * width, s * length + c * width, height], axis=-1)
    # Relative deficit of solidity from a face of as many rays.
    n = np.maximum(found.n_points, 2.0)
    porosity = np.clip(1.0 - found.solidity / (1.0 - 1.5 / np.sqrt(n) + 0.5 / n), 0.0, 1.0)
    means = np.stack([_evidence(found, is_asked), found.part_of >= 0, porosity], axis=-1)
    return SegmentTerms(np.hstack([boxes.center - half, boxes.center + half]), means, (known > 0.0) | is_asked)


def judge_tracks(
    tracks: Tracks, terms: Sequence[SegmentTerms], settings: JudgeSettings, shifts: Array | None = None
) -> Verdicts:
    """Return moving for every track that has moved with at least the probability `settings.min_probability`.

    The confidence is the probability that the verdict is right. Tracks with a single observation, or without any known
    point, are static, because the prior holds for objects on which other scans were asked.

    Parameters
    ----------
    terms : sequence of SegmentTerms, one per scan.
    shifts : (N,) float64, optional, log-odds added for observations in each scan; their mean over a track's scans
        counts. Where they are positive, tracks with a single observation are judged, too.
    """
    log_odds = PRIOR + track_terms(tracks, terms) @ np.array(list(WEIGHTS.values()))
    scan, owner = tracks.scan[tracks.is_observed], tracks.track[tracks.is_observed]
    n_seen, is_known = np.bincount(owner, minlength=len(tracks)), _seen(tracks, [of.is_known for of in terms])
    if shifts is not None:
        log_odds += np.bincount(owner, shifts[scan], len(tracks)) / np.maximum(n_seen, 1)
        n_seen += np.bincount(owner, shifts[scan] > 0.0, len(tracks)).astype(np.int64)
    probability = np.where((n_seen > 1) & is_known, 1.0 / (1.0 + np.exp(-np.clip(log_odds, -30.0, 30.0))), 0.0)
    is_moving = probability >= settings.min_probability
    verdict = np.where(is_moving, Verdict.MOVING, Verdict.STATIC).astype(np.int8)
    return Verdicts(verdict, np.where(is_moving, probability, 1.0 - probability))


def without_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> tuple[Tracks, Verdicts]:
    """Return the tracks and their verdicts without those that have stayed in every scan and do not move."""
    is_kept = ~is_scenery(tracks, verdicts, detections)
    kept = tracks[is_kept[tracks.track]]
    return replace(kept, track=(np.cumsum(is_kept) - 1)[kept.track]), verdicts[is_kept]


def is_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> Mask:
    """Return (T,) which tracks have stayed in every scan and do not move."""
    return ~_seen(tracks, [~found.has_stayed for found in detections]) & ~verdicts.is_moving


def track_terms(tracks: Tracks, terms: Sequence[SegmentTerms]) -> Array:
    """Return (T, 5) the unweighted terms of each track, in the order of `WEIGHTS`."""
    seen = np.flatnonzero(tracks.is_observed)
    if len(seen) == 0:
        return np.zeros((len(tracks), len(WEIGHTS)))
    first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
    of_rows = SegmentTerms.concatenate(list(terms))[_segments(tracks, seen, terms)]
    evidence, piece, porosity = (
        np.bincount(tracks.track[seen], values, len(tracks)) / np.diff(first) for values in of_rows.means.T
    )
    displacement, scatter = follow_faces(first, of_rows.faces)
    low, high = displacement[:, 0:2], displacement[:, 3:5]
    squared = np.where(low * high > 0.0, np.minimum(np.abs(low), np.abs(high)) ** 2, 0.0).sum(axis=1)
    noise = NOISE + np.sqrt(np.minimum(scatter[:, 0] + scatter[:, 1], scatter[:, 3] + scatter[:, 4]))
    out = {
        "evidence": -np.log((1.0 - MISJUDGED) * np.exp(-LOOKS * evidence) + MISJUDGED),
        "displacement": np.log(1.0 + squared / noise**2),
        "unsteady": np.log(1.0 + np.sqrt(np.minimum(scatter[:, 2], scatter[:, 5])) / NOISE),
        "pieces": piece,
        "porous": porosity / np.maximum(1.0 - porosity, LEAST_SOLID),
    }
    return np.stack([out[term] for term in WEIGHTS], axis=1)


def _evidence(found: Detections, is_asked: bool) -> Array:
    """Return (M,) the log-likelihood ratio of each segment, moved against stayed, from the counts of its points.

    Unknown points are left out unless `is_asked`: the shares among the known points do not depend on them.
    """
    known = found.n_moving + found.n_static
    unknown = np.maximum(found.n_points - known, 0.0)
    counts = np.stack([found.n_moving, found.n_static, unknown][: 3 if is_asked else 2], axis=-1)
    ratio = _log_dirichlet(counts, MOVED) - _log_dirichlet(counts, STAYED)
    if not is_asked:
        ratio = ratio * np.minimum(known / np.maximum(known + unknown, 1e-9) / ENOUGH_KNOWN, 1.0)
    return np.log(UNDER_WAY * np.exp(np.minimum(ratio, 50.0)) + 1.0 - UNDER_WAY)


def _log_dirichlet(counts: Array, distribution: tuple[float, ...]) -> Array:
    """Return (M,) the log-likelihood of `counts` (M, C) under the first C parameters of the Dirichlet distribution."""
    prior = np.array(distribution[: counts.shape[1]])
    total = gammaln(prior.sum()) - gammaln(prior.sum() + counts.sum(axis=1))
    return total + (gammaln(prior + counts) - gammaln(prior)).sum(axis=1)


def _seen(tracks: Tracks, is_so: Sequence[Mask]) -> Mask:
    """Return (T,) which tracks were observed as a segment for which `is_so`, given per scan, is True."""
    out, rows = np.zeros(len(tracks), np.bool_), np.flatnonzero(tracks.is_observed)
    if len(rows):
        out[tracks.track[rows[np.concatenate(is_so)[_segments(tracks, rows, is_so)]]]] = True
    return out


def _segments(tracks: Tracks, seen: npt.NDArray[np.int64], per_scan: Sequence[Sized]) -> npt.NDArray[np.int64]:
    """Return (K,) the segment of each of the rows `seen` (K,), numbered through all scans."""
    begins = np.cumsum([0, *(len(of_scan) for of_scan in per_scan)])
    return begins[tracks.scan[seen]] + tracks.segment[seen]
