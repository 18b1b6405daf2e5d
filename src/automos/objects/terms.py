"""What each segment of a scan says of the body that it belongs to: whether that has moved, by its points and its face.

*Evidence*: the points of a scan are correlated, so the numbers of moved, stayed and unknown ones follow a
Dirichlet-multinomial distribution in either state. Where poses are off it is wrong, so it is a mixture with its own
opposite, which bounds what one look can say.

*Body*: pieces that the evidence cut out of a segment are seldom objects. The face of a vehicle or a person returns all
rays that meet it; rain, dust, spray and leaves let rays through. On a square face of n rays, the share 1 - 1.5 /
sqrt(n) + 0.5 / n of the neighbours of a ray are on the face, too; porosity is the missing part of that share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
WRONG = 0.001  # share of looks in which the evidence is that of the other state
BODY, PIECE, POROUS = 1.8, -3.2, -0.5  # log-odds of moving per look: of all, of pieces, and per unit of porosity
LEAST_SOLID = 0.1  # lower limit of solidity relative to that of a solid face


@dataclass(frozen=True, eq=False)
class SegmentTerms(ColumnData):
    """The terms of the M segments of one scan for the tracks they belong to; and what else is kept of each.

    Attributes
    ----------
    faces : (M, 4) float64, metres: the centre along x and y, and the heights of the lower and of the upper face.
    evidence : (M,) float64, log-likelihood ratio of the points, moved against stayed, plus that of being a body.
    of_rest : (M,) float64, the same without the points of the pieces that were cut out of it.
    part_of : (M,) int, the segment that it was cut out of, -1 for none.
    n_points : (M,) float32, number of its points.
    has_stayed : (M,) bool, see `Detections`.
    """

    faces: Array
    evidence: Array
    of_rest: Array
    part_of: npt.NDArray[np.integer]
    n_points: npt.NDArray[np.float32]
    has_stayed: npt.NDArray[np.bool_]


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
    def of_scans(cls, scans: Sequence[SegmentTerms]) -> Segments:
        """Return the segments of all `scans`."""
        begins = np.cumsum([0, *map(len, scans)])
        terms = SegmentTerms.concatenate([segment_terms(Detections.nothing()), *scans])
        is_part, first = terms.part_of >= 0, np.repeat(begins[:-1], np.diff(begins))
        return cls(replace(terms, part_of=np.where(is_part, terms.part_of + first, -1)), begins)

    def of(self, tracks: Tracks) -> npt.NDArray[np.int64]:
        """Return (R,) the number of the segment of each row of `tracks`, -1 where there is none."""
        return np.where(tracks.is_observed, self.begins[tracks.scan] + tracks.segment, -1)


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
    pieces, counts = found[np.flatnonzero(found.part_of >= 0)], ("n_points", "n_moving", "n_static")
    cut = {name: np.bincount(pieces.part_of, getattr(pieces, name), len(found)) for name in counts}
    rest = replace(found, **{name: getattr(found, name) - of_pieces for name, of_pieces in cut.items()})
    evidence, of_rest = (says * (BODY + of_bodies + doubted(_evidence(of, is_asked), WRONG)) for of in (found, rest))
    faces, n_points = np.stack([x, y, z - half, z + half], axis=-1), found.n_points.astype(np.float32)
    return SegmentTerms(faces, evidence, of_rest, found.part_of, n_points, found.has_stayed)


def each_for_itself(segments: Segments, tracks: Tracks) -> Segments:
    """Return `segments` in which no point speaks for two things: for a mover, and for what it was cut out of.

    A piece is a thing of its own if its track is no piece in most of its scans, as who passes a parked car closely. The
    moved edges of a lorry are never anything else.
    """
    terms = segments.terms
    whole = np.append(terms.part_of, -1)[segments.of(tracks)]
    n_seen, n_as_piece = (np.bincount(tracks.track, rows, len(tracks)) for rows in (tracks.is_observed, whole >= 0))
    is_own = n_as_piece < 0.5 * n_seen
    is_lent = np.zeros(len(terms), np.bool_)
    is_lent[whole[(whole >= 0) & is_own[tracks.track]]] = True
    said = np.where(is_lent, terms.of_rest, terms.evidence)
    return replace(segments, terms=replace(terms, evidence=said, of_rest=said))


def doubted(log_ratio: Array, wrong: float) -> Array:
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
