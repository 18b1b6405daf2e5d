"""Has it moved? The log-odds of a track, from the evidence and from its motion (the `default` preset's verdict).

    log odds(moved) = prior + evidence + displacement - unsteadiness - pieces - porosity

Each term is a log-likelihood ratio, "it moved" against "it stayed", times a weight; weights and distributions were
fitted once, by maximum likelihood, on tracks of simulated worlds, so that the sum is calibrated.

*Evidence*: of a thing that stays, now and then some points are observed free (an edge, foliage), of one that moves
more are; and the points of one scan agree with each other. So how many of them have moved, have stayed and are unknown
is Dirichlet-multinomial under either hypothesis, which caps what one scan of many points can say; and since a mover may
as well stand for a while, a scan can hardly speak against it. Scans that look at the same place agree, too: it is their
mean that counts, as two looks; and where poses are off the evidence is wrong as a whole, so that all of it is worth no
more than the odds of that.

*Displacement*: a thing that goes takes both its faces along, one of which more comes into sight only one. So each axis
counts the lesser of its two faces' paths, if they go the same way; the noise is the scatter of the steadier face about
its own path. Segments jump, so the noise has heavy tails (Cauchy): what is far for its scatter counts by its logarithm.

*Unsteadiness, pieces*: vehicles and people stand on the ground, and their foot or their roof keeps its height from scan
to scan; segments of trees and walls do not. What is no whole segment, but what the evidence cut out of one, is seldom
an object.

*Porosity*: the face of a vehicle or a person returns all rays that meet it; rain, dust, spray and leaves come and go as
movers do, but let rays through. Of a square face of n rays, 1 - 1.5 / sqrt(n) + 0.5 / n of the neighbours of a ray lie
on it too; what is missing of that share is the porosity. The rays it lets through for each that it returns count:
some are lost at every edge, most in a cloud.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from automos.detections import Detections
from automos.scan import Mask
from automos.settings import JudgeSettings
from automos.tracking.face_paths import follow_faces
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdict, Verdicts

Array = npt.NDArray[np.float64]

PRIOR = 1.60
"""Log-odds of something of which nothing is known but that it was seen twice as one segment."""
WEIGHTS = {
    "evidence": 0.89,
    "displacement": 0.41,  # of how far it went for its scatter
    "unsteady": -0.92,  # of how its foot and its roof change their heights
    "pieces": -3.82,  # of its being no whole segment but what the evidence cut out of one
    "porous": -3.00,  # of the rays it lets through for each that it returns
}
"""Of the terms, by name, as `benchmarks/fit_judge.py` finds them on simulated worlds, in rain and with specks, too. The
last was fitted anew, beside the others: it is 2.4 without dust, 3.2 in nothing but dust, 3.0 on all worlds."""
MOVED = (1.02, 0.49, 0.455)
"""Dirichlet distribution of the shares of moved, stayed and unknown points in a scan of a mover under way."""
STAYED = (0.18, 0.98, 0.455)
"""The same of what stays."""
ENOUGH_KNOWN = 0.2
"""Share of a thing's points that speaks for all of it, before others were asked; less than that are edges, too."""
UNDER_WAY = 0.986
"""Share of its scans in which the evidence knows of a mover."""
LOOKS = 2.2
"""How many looks that know nothing of each other all scans of a track are worth."""
MISJUDGED = 0.03
"""Share of what stays of which the evidence is wrong in all scans: the poses are off there, or it is thin and bare."""
LEAST_SOLID = 0.02
"""Share of the rays that meet a thing and end there, to its face's: less is as good as none."""
NOISE = 0.05
"""Metres, scatter that no face of a tracked box is without."""


@dataclass(frozen=True, eq=False)
class SegmentTerms:
    """What each of the M segments of one scan says of the track it belongs to.

    Attributes
    ----------
    faces : (M, 6) metres, x, y, z of its low and of its high sides.
    evidence : (M,) log-likelihood ratio that it moves, of what its points say.
    columns : (M, 2) 1 for what is no whole segment; porosity in [0, 1].
    is_known : (M,) bool, whether anything is known of it: others were asked, or speak of a point of it already.
    """

    faces: Array
    evidence: Array
    columns: Array
    is_known: Mask


def segment_terms(found: Detections, is_asked: bool = True) -> SegmentTerms:
    """Return what the segments of a scan say.

    What nobody saw again speaks against a mover, if anybody was asked: others from a second or more. Until then
    (`is_asked` is False) the known points speak, split as the same distributions say, if they are enough of the thing.
    """
    boxes, known = found.boxes, found.n_moving + found.n_static
    c, s = np.abs(np.cos(boxes.yaw)), np.abs(np.sin(boxes.yaw))
    length, width, height = boxes.size.T
    half = 0.5 * np.stack([c * length + s * width, s * length + c * width, height], axis=-1)
    columns = np.stack([found.part_of >= 0, _porosity(found)], axis=-1)
    faces = np.hstack([boxes.center - half, boxes.center + half])
    return SegmentTerms(faces, _evidence(found, is_asked), columns, (known > 0.0) | is_asked)


def judge_tracks(
    tracks: Tracks, terms: Sequence[SegmentTerms], settings: JudgeSettings, shifts: Array | None = None
) -> Verdicts:
    """Return moving for every track that has moved with at least the probability `settings.min_probability`.

    The confidence is the probability that the verdict is right. What was seen once, or has no point that anything is
    known of, is static: the prior is that of things of which others were asked.

    Parameters
    ----------
    terms : per scan, what its segments say.
    shifts : (N,) log-odds to add for what was seen in each scan, their mean over a track's scans. In a scan with more
        than none, what is seen for the first time is judged, too.
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
    """Return the tracks, and the verdicts on them, of all but what has stayed in every scan and does not move."""
    is_kept = ~is_scenery(tracks, verdicts, detections)
    number = np.cumsum(is_kept) - 1
    kept = tracks[np.flatnonzero(is_kept[tracks.track])]
    return replace(kept, track=number[kept.track]), Verdicts(verdicts.verdict[is_kept], verdicts.confidence[is_kept])


def is_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> Mask:
    """Return (T,) which tracks have stayed in every scan and do not move."""
    return ~_seen(tracks, [~found.has_stayed for found in detections]) & ~verdicts.is_moving


def track_terms(tracks: Tracks, terms: Sequence[SegmentTerms]) -> Array:
    """Return (T, 5) what the verdict adds up of each track, unweighted, in the order of `WEIGHTS`."""
    seen = np.flatnonzero(tracks.is_observed)
    if len(seen) == 0:
        return np.zeros((len(tracks), len(WEIGHTS)))
    first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
    segment = _segments(tracks, seen, [of_scan.evidence for of_scan in terms])
    faces, evidence, columns = (
        np.concatenate([getattr(of_scan, name) for of_scan in terms])[segment]
        for name in ("faces", "evidence", "columns")
    )
    evidence, piece, porosity = (
        np.bincount(tracks.track[seen], values, len(tracks)) / np.diff(first) for values in (evidence, *columns.T)
    )
    gone, scatter = follow_faces(first, faces)
    low, high = gone[:, 0:2], gone[:, 3:5]
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
    """Return (M,) the log-likelihood ratio that each segment moves, of how many of its points have moved and stayed.

    The unknown ones are left out where nobody `is_asked`: shares among the others do not depend on theirs.
    """
    known = found.n_moving + found.n_static
    unknown = np.maximum(found.n_points - known, 0.0)
    counts = np.stack([found.n_moving, found.n_static, unknown][: 3 if is_asked else 2], axis=-1)
    ratio = _log_dirichlet(counts, MOVED) - _log_dirichlet(counts, STAYED)
    if not is_asked:
        ratio = ratio * np.minimum(known / np.maximum(known + unknown, 1e-9) / ENOUGH_KNOWN, 1.0)
    return np.log(UNDER_WAY * np.exp(np.minimum(ratio, 50.0)) + 1.0 - UNDER_WAY)


def _log_dirichlet(counts: Array, distribution: tuple[float, ...]) -> Array:
    """Return (M,) the log-likelihood of `counts` (M, C) whose shares have the Dirichlet distribution, its first C."""
    prior = np.array(distribution[: counts.shape[1]])
    total = gammaln(prior.sum()) - gammaln(prior.sum() + counts.sum(axis=1))
    return total + (gammaln(prior + counts) - gammaln(prior)).sum(axis=1)


def _porosity(found: Detections) -> Array:
    """Return (M,) in [0, 1]: how much less solid than a face of as many rays each segment is."""
    n = np.maximum(found.n_points, 2.0)
    return np.clip(1.0 - found.solidity / (1.0 - 1.5 / np.sqrt(n) + 0.5 / n), 0.0, 1.0)


def _seen(tracks: Tracks, is_so: Sequence[Mask]) -> Mask:
    """Return (T,) which tracks were seen as any segment, of those by scan, of which it `is_so`."""
    out, rows = np.zeros(len(tracks), np.bool_), np.flatnonzero(tracks.is_observed)
    if len(rows):
        out[tracks.track[rows[np.concatenate(is_so)[_segments(tracks, rows, is_so)]]]] = True
    return out


def _segments(tracks: Tracks, seen: npt.NDArray[np.int64], per_scan: Sequence[Sized]) -> npt.NDArray[np.int64]:
    """Return (K,) the segment of each of the rows `seen` (K,), counted through all scans."""
    begins = np.cumsum([0, *(len(of_scan) for of_scan in per_scan)])
    return begins[tracks.scan[seen]] + tracks.segment[seen]
