"""What each segment of a scan says of the body that it belongs to: whether that has moved, by its points and its face.

*Evidence*: the points of a scan are correlated, so the numbers of moved, stayed and unknown ones follow a
Dirichlet-multinomial distribution in either state. Where poses are off it is wrong, so it is a mixture with its own
opposite, which bounds what one look can say.

*Body*: pieces that the evidence cut out of a segment are seldom objects. The face of a vehicle or a person returns all
rays that meet it; rain, dust, spray and leaves let rays through. On a square face of n rays, the share 1 - 1.5 /
sqrt(n) + 0.5 / n of the neighbours of a ray are on the face, too; porosity is the missing part of that share.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from automos.core.column_data import ColumnData
from automos.objects.detections import Detections
from automos.objects.tracks import Tracks

Array = npt.NDArray[np.float64]

MOVED, STAYED = (1.02, 0.49, 0.455), (0.18, 0.98, 0.455)
"""Dirichlet distributions of the shares of moved, stayed and unknown points in a scan: of a mover in motion, and of a
static object."""
KEPT = 60.0  # how firmly shares are kept from look to look, in points
WRONG = 0.001  # share of looks in which the evidence is that of the other state
CHANCE = 0.01  # share of points that are moved, or stayed, by mistake; and of looks at boxes that are cut or joined
BODY, PIECE, POROUS = 1.8, -3.2, -0.5  # log-odds of moving per look: of all, of pieces, and per unit of porosity
LEAST_SOLID = 0.1  # lower limit of solidity relative to that of a solid face


@dataclass(frozen=True, eq=False)
class SegmentTerms(ColumnData):
    """The terms of the M segments of one scan for the tracks they belong to; and what else is kept of each.

    Attributes
    ----------
    faces : (M, 4) float64, metres: the centre along x and y, and the heights of the lower and of the upper face.
    ends : (M, 2, 2) float32, metres: left and right end along x and y, NaN where something nearer hides it.
    sensor : (M, 2) float32, metres: from where it was seen.
    evidence : (M,) float64, log-likelihood ratio of the points, moved against stayed, plus that of being a body.
    counts : (M, 3) float32, numbers of all its points, of those that have moved and of those that have stayed.
    is_asked : (M,) bool, whether scans a second or more away were asked.
    part_of : (M,) int, the segment that it was cut out of, -1 for none.
    has_stayed : (M,) bool, hidden : (M, 2) bool, and outline : (M, K, 2) float16, metres; see `Detections`.
    side : (M, 2) float32, metres along x and y: the longer side of its box.
    """

    faces: Array
    ends: npt.NDArray[np.float32]
    sensor: npt.NDArray[np.float32]
    evidence: Array
    counts: npt.NDArray[np.float32]
    is_asked: npt.NDArray[np.bool_]
    part_of: npt.NDArray[np.integer]
    has_stayed: npt.NDArray[np.bool_]
    hidden: npt.NDArray[np.bool_]
    outline: npt.NDArray[np.float16]
    side: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Segments:
    """The segments of N scans, M in all, numbered from scan to scan.

    Attributes
    ----------
    terms : SegmentTerms of all, (M,).
    begins : (N + 1,) int64, number of the first segment of each scan, and M.
    """

    terms: SegmentTerms
    begins: npt.NDArray[np.int64]

    @classmethod
    def of_scans(cls, scans: list[SegmentTerms]) -> Segments:
        """Return the segments of all `scans`, a list that is emptied: a column at a time is there twice."""
        begins = np.cumsum([0, *map(len, scans)])
        columns = [list(of.to_arrays().values()) for of in (segment_terms(Detections.nothing()), *scans)]
        scans.clear()
        terms = SegmentTerms(*(np.concatenate([of.pop(0) for of in columns]) for _ in fields(SegmentTerms)))
        is_part, first = terms.part_of >= 0, np.repeat(begins[:-1], np.diff(begins))
        return cls(replace(terms, part_of=np.where(is_part, terms.part_of + first, -1)), begins)

    def of(self, tracks: Tracks) -> npt.NDArray[np.int64]:
        """Return (R,) the number of the segment of each row of `tracks`, -1 where there is none."""
        return np.where(tracks.is_observed, self.begins[tracks.scan] + tracks.segment, -1)

    def counts_of(self, tracks: Tracks) -> Array:
        """Return (T, 2) how many points the segments of each track have, and how many of them have moved."""
        rows = np.flatnonzero(tracks.is_observed)
        counts = self.terms.counts[self.of(tracks)[rows], :2]
        return np.stack([np.bincount(tracks.track[rows], column, len(tracks)) for column in counts.T], axis=1)


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
    counts = np.stack([found.n_points, found.n_moving, found.n_static], axis=-1)
    asked = np.full(len(found), is_asked)
    says = is_asked | (_known(counts, asked).sum(axis=-1) > 0.0)
    evidence = says * (BODY + of_bodies + _evidence(counts, asked))
    faces = np.stack([x, y, z - half, z + half], axis=-1)
    kept = counts.astype(np.float32), asked, found.part_of, found.has_stayed, found.hidden
    length, yaw = found.boxes.size[:, :1], found.boxes.yaw
    side = (length * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)).astype(np.float32)
    return SegmentTerms(
        faces, _ends(found), found.sensor.astype(np.float32), evidence, *kept, found.outline.astype(np.float16), side
    )


def each_for_itself(segments: Segments, tracks: Tracks) -> Segments:
    """Return `segments` in which no point speaks for two things: for a mover, and for what it was cut out of.

    A piece is a thing of its own if its track came there from elsewhere and is no piece in most of its scans, as who
    passes a parked car closely. The moved edges of a lorry are never anything else; what begins as a piece, or stood
    there, is the body itself that sets off.
    """
    terms, segment = segments.terms, segments.of(tracks)
    is_piece = np.append(terms.part_of, -1)[segment] >= 0
    n_seen, n_as_piece = (np.bincount(tracks.track, rows, len(tracks)) for rows in (tracks.is_observed, is_piece))
    first = tracks.first_rows()
    is_own = (n_as_piece < 0.5 * n_seen) & ~is_piece[first] & ~np.append(terms.has_stayed, False)[segment[first]]
    pieces = segment[is_piece & is_own[tracks.track]]
    wholes, of_piece = np.unique(terms.part_of[pieces], return_inverse=True)
    lent, counts = np.zeros((len(wholes), 3)), terms.counts[wholes].astype(np.float64)
    np.add.at(lent, of_piece, terms.counts[pieces])
    evidence, asked = terms.evidence.copy(), terms.is_asked[wholes]
    evidence[wholes] += _evidence(counts - lent, asked) - _evidence(counts, asked)
    return replace(segments, terms=replace(terms, evidence=evidence))


def _ends(found: Detections) -> npt.NDArray[np.float32]:
    """Return (M, 2, 2) the corners of the boxes farthest to the left and to the right, NaN where they are no ends."""
    away, corners = (found.boxes.center[:, :2] - found.sensor) @ [1.0, 1j], found.boxes.corners()
    bearing = np.angle((corners - found.sensor[:, None]) @ [1.0, 1j] * away.conj()[:, None])
    left_right = np.stack([bearing.argmax(axis=1), bearing.argmin(axis=1)], axis=-1)
    ends = np.take_along_axis(corners, left_right[..., None], axis=1).astype(np.float32)
    ends[found.hidden | (found.part_of >= 0)[:, None]] = np.nan  # a piece ends where the evidence does
    return ends


def doubted(log_ratio: Array, wrong: float) -> Array:
    """Return the log-likelihood ratio of two hypotheses, each of which looks as the other in a share `wrong`."""
    log_ratio = np.clip(log_ratio, -100.0, 100.0)
    sure, doubt = np.log1p(-wrong), np.log(wrong)
    return np.logaddexp(sure + log_ratio, doubt) - np.logaddexp(sure, doubt + log_ratio)


def log_ratio_of_shares(known: Array, before: Array, chance: Array) -> Array:
    """Return (M,) the log-likelihood ratio of what sets off, against what stands as it did.

    known : (M, 2) points that have moved, and that have stayed.   before : (M, 2) the same while it stood, in any unit.
    chance : (M,) how often the shares of what stands are others.
    """
    kept = KEPT * before / before.sum(axis=1, keepdims=True)
    as_before = np.log1p(-chance) + _log_dirichlet(known, np.array(STAYED[:2]) + kept)
    return _log_dirichlet(known, MOVED) - np.logaddexp(as_before, np.log(chance) + _log_dirichlet(known, STAYED))


def _evidence(counts: Array, is_asked: npt.NDArray[np.bool_]) -> Array:
    """Return (M,) the log-likelihood ratio of segments, moved against stayed, from the `counts` (M, 3) of their points.

    See `SegmentTerms`. Where others were not asked, unknown points say nothing.
    """
    n, (n_moving, n_static) = counts[:, 0], _known(counts, is_asked).T
    parts = np.stack([n_moving, n_static, np.maximum(n - n_moving - n_static, 0.0)], axis=-1)
    of_all, of_known = (_log_dirichlet(some, MOVED) - _log_dirichlet(some, STAYED) for some in (parts, parts[:, :2]))
    return doubted(np.where(is_asked, of_all, of_known), WRONG)


def _known(counts: Array, is_asked: npt.NDArray[np.bool_]) -> Array:
    """Return (M, 2) the numbers of moved and of stayed points; what some say while most are unknown may be chance."""
    by_chance = np.where(is_asked, 0.0, CHANCE * counts[:, 0])
    return np.maximum(counts[:, 1:] - by_chance[:, None], 0.0)


def _log_dirichlet(counts: Array, distribution: tuple[float, ...] | Array) -> Array:
    """Return (M,) the log-likelihood of `counts` (M, C) under the first C parameters of Dirichlet distributions."""
    prior = np.array(distribution)[..., : counts.shape[1]]
    total = gammaln(prior.sum(axis=-1)) - gammaln(prior.sum(axis=-1) + counts.sum(axis=1))
    return total + (gammaln(prior + counts) - gammaln(prior)).sum(axis=1)
