"""Has it moved? The log-odds of a track, from the evidence and from its motion (the `default` preset's verdict).

    log odds(moved) = prior + evidence + displacement - unsteadiness - pieces - porosity

Each term is a log-likelihood ratio, "it moved" against "it stayed", times a weight; weights and distributions were
fitted once, by maximum likelihood, on tracks of simulated worlds, so that the sum is calibrated.

*Evidence*: of a thing that stays, now and then some points are seen through (an edge, foliage), of one that moves
more are; and the points of one scan agree with each other. So how many of them have moved, have stayed and are unknown
is Dirichlet-multinomial under either hypothesis, which caps what one scan of many points can say; and since a mover may
as well stand for a while, a scan can hardly speak against it. Scans that look at the same place agree, too: it is their
mean that counts, as two looks; and where poses are off the evidence is wrong as a whole, so that all of it is worth no
more than the odds of that.

*Displacement*: a thing that goes takes both its faces along, one of which more comes into sight only one. So each axis
counts the lesser of its two faces' ways, if they go the same way; the noise is the scatter of the steadier face about
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

import math
from collections.abc import Sequence, Sized
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.kernels import kernel
from automos.settings import JudgeSettings
from automos.tracking.face_paths import distance_gone, scatter
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
"""Share of the rays that meet a thing and end there, to its face's: less is not told from none."""
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
    is_known: npt.NDArray[np.bool_]


def segment_terms(found: Detections, is_asked: bool = True) -> SegmentTerms:
    """Return what the segments of a scan say.

    What nobody saw again speaks against a mover, if anybody was asked: others from a second or more. Until then
    (`is_asked` is False) the known points speak, split as the same distributions say, if they are enough of the thing.
    """
    boxes = found.boxes
    c, s = np.abs(np.cos(boxes.yaw)), np.abs(np.sin(boxes.yaw))
    length, width, height = boxes.size.T
    half = 0.5 * np.stack([c * length + s * width, s * length + c * width, height], axis=-1)
    unknown = np.maximum(found.n_points - found.n_moving - found.n_static, 0.0)
    counts = np.stack([found.n_moving, found.n_static, unknown if is_asked else -np.maximum(unknown, 1e-9)], axis=-1)
    evidence = np.empty(len(found))
    _weigh_counts(counts, evidence)
    columns = np.stack([found.part_of >= 0, _porosity(found)], axis=-1)
    is_known = (found.n_moving + found.n_static > 0.0) | is_asked
    return SegmentTerms(np.hstack([boxes.center - half, boxes.center + half]), evidence, columns, is_known)


def judge_by_evidence(tracks: Tracks, detections: Sequence[Detections], settings: JudgeSettings) -> Verdicts:
    """Return moving for every track that has moved with at least the probability `settings.min_probability`.

    The confidence is the probability that the verdict is right. What was seen once, or has no point that anything is
    known of, is static: the prior is that of things of which others were asked.

    Parameters
    ----------
    detections : per scan, its segments.
    """
    return judge_tracks(tracks, [segment_terms(found) for found in detections], settings)


def judge_tracks(
    tracks: Tracks, terms: Sequence[SegmentTerms], settings: JudgeSettings, shifts: Array | None = None
) -> Verdicts:
    """Return the same as `judge_by_evidence` from the `terms` of each scan's segments.

    shifts : (N,) log-odds to add for what was seen in each scan, their mean over a track's scans. In a scan with more
        than none, what is seen for the first time is judged, too.
    """
    log_odds = PRIOR + track_terms(tracks, terms) @ np.array(list(WEIGHTS.values()))
    scan, owner = tracks.scan[tracks.is_observed], tracks.track[tracks.is_observed]
    n_seen, is_known = np.bincount(owner, minlength=len(tracks)), _is_known(tracks, terms)
    if shifts is not None:
        log_odds += np.bincount(owner, shifts[scan], len(tracks)) / np.maximum(n_seen, 1)
        n_seen += np.bincount(owner, shifts[scan] > 0.0, len(tracks)).astype(np.int64)
    probability = np.where((n_seen > 1) & is_known, 1.0 / (1.0 + np.exp(-np.clip(log_odds, -30.0, 30.0))), 0.0)
    is_moving = probability >= settings.min_probability
    verdict = np.where(is_moving, Verdict.MOVING, Verdict.STATIC).astype(np.int8)
    return Verdicts(verdict, np.where(is_moving, probability, 1.0 - probability))


def _is_known(tracks: Tracks, terms: Sequence[SegmentTerms]) -> npt.NDArray[np.bool_]:
    """Return (T,) of which tracks anything is known in any scan."""
    known = np.zeros(len(tracks), np.bool_)
    known[_seen(tracks, [of_scan.is_known for of_scan in terms], True)] = True
    return known


def without_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> tuple[Tracks, Verdicts]:
    """Return the tracks, and the verdicts on them, of all but what has stayed in every scan and does not move."""
    is_kept = ~is_scenery(tracks, verdicts, detections)
    number = np.cumsum(is_kept) - 1
    kept = tracks[np.flatnonzero(is_kept[tracks.track])]
    return replace(kept, track=number[kept.track]), Verdicts(verdicts.verdict[is_kept], verdicts.confidence[is_kept])


def is_scenery(tracks: Tracks, verdicts: Verdicts, detections: Sequence[Detections]) -> npt.NDArray[np.bool_]:
    """Return (T,) which tracks have stayed in every scan and do not move."""
    stays = np.ones(len(tracks), np.bool_)
    stays[_seen(tracks, [found.has_stayed for found in detections], False)] = False
    return stays & ~verdicts.is_moving


def track_terms(tracks: Tracks, terms: Sequence[SegmentTerms]) -> Array:
    """Return (T, 5) what the verdict adds up of each track, unweighted, in the order of `WEIGHTS`."""
    out = np.zeros((len(tracks), len(WEIGHTS)))
    seen = np.flatnonzero(tracks.is_observed)
    if len(seen) == 0:
        return out
    first = np.searchsorted(tracks.track[seen], np.arange(len(tracks) + 1))
    segment = _segments(tracks, seen, [of_scan.evidence for of_scan in terms])
    faces, evidence, columns = (
        np.concatenate([getattr(of_scan, name) for of_scan in terms])[segment]
        for name in ("faces", "evidence", "columns")
    )
    _add_up(first, faces, evidence, out)
    for term, values in enumerate(columns.T, start=3):
        out[:, term] = np.bincount(tracks.track[seen], values, len(tracks)) / np.diff(first)
    out[:, -1] /= np.maximum(1.0 - out[:, -1], LEAST_SOLID)
    return out


def _porosity(found: Detections) -> Array:
    """Return (M,) in [0, 1]: how much less solid than a face of as many rays each segment is."""
    n = np.maximum(found.n_points, 2.0)
    return np.clip(1.0 - found.solidity / (1.0 - 1.5 / np.sqrt(n) + 0.5 / n), 0.0, 1.0)


def _seen(tracks: Tracks, is_so: Sequence[npt.NDArray[np.bool_]], wanted: bool) -> npt.NDArray[np.int64]:
    """Return the track of every row that was seen as a segment of which, by scan, it `is_so` or, as wanted, is not."""
    seen = np.flatnonzero(tracks.is_observed)
    if len(seen) == 0:
        return seen
    return tracks.track[seen[np.concatenate(is_so)[_segments(tracks, seen, is_so)] == wanted]]


def _segments(tracks: Tracks, seen: npt.NDArray[np.int64], per_scan: Sequence[Sized]) -> npt.NDArray[np.int64]:
    """Return (K,) the segment of each of the rows `seen` (K,), counted through all scans."""
    begins = np.cumsum([0, *(len(of_scan) for of_scan in per_scan)])
    return begins[tracks.scan[seen]] + tracks.segment[seen]


@kernel
def _weigh_counts(counts, evidence):  # type: ignore[no-untyped-def]
    for i in range(len(counts)):
        ratio = _log_dirichlet(counts[i], MOVED) - _log_dirichlet(counts[i], STAYED)
        if counts[i, 2] < 0.0:
            known = counts[i, 0] + counts[i, 1]
            ratio *= min(known / (known - counts[i, 2]) / ENOUGH_KNOWN, 1.0)
        evidence[i] = math.log(UNDER_WAY * math.exp(min(ratio, 50.0)) + 1.0 - UNDER_WAY)


@kernel
def _add_up(first, faces, evidence, terms):  # type: ignore[no-untyped-def]
    """Write the first three terms of each track. Reductions of arrays would triple what this takes to compile."""
    scatters = np.empty(6)
    for k in range(len(first) - 1):
        a, b = first[k], first[k + 1]
        for i in range(a, b):
            terms[k, 0] += evidence[i] / (b - a)
        terms[k, 0] = -math.log((1.0 - MISJUDGED) * math.exp(-LOOKS * terms[k, 0]) + MISJUDGED)
        way = 0.0
        for axis in range(2):
            low_way, high_way = distance_gone(faces, a, b, axis), distance_gone(faces, a, b, 3 + axis)
            if low_way * high_way > 0.0:
                way += min(abs(low_way), abs(high_way)) ** 2
        for face in range(6):  # numba compiles a function anew for every number that is written out
            scatters[face] = scatter(faces, a, b, face)
        of_low, of_high = scatters[0] + scatters[1], scatters[3] + scatters[4]
        terms[k, 1] = math.log(1.0 + way / (NOISE + math.sqrt(min(of_low, of_high))) ** 2)
        unsteady = min(scatters[2], scatters[5])
        terms[k, 2] = math.log(1.0 + math.sqrt(unsteady) / NOISE)


@kernel
def _log_dirichlet(counts, prior):  # type: ignore[no-untyped-def]
    """Return the log-likelihood of `counts` (3,) whose shares have the Dirichlet distribution `prior`.

    A negative last count is left out: the shares of the others among themselves do not depend on it.
    """
    n = 2 if counts[2] < 0.0 else 3
    total = of_all = 0.0
    for c in range(n):
        total += prior[c]
        of_all += counts[c]
    value = math.lgamma(total) - math.lgamma(total + of_all)
    for c in range(n):
        value += math.lgamma(prior[c] + counts[c]) - math.lgamma(prior[c])
    return value
