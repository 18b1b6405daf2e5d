"""Points that true movers and found tracks share, scan by scan, and what follows from them: HOTA and IDF1.

A detection is what a scan holds of one mover, or of one moving track; two are as similar as the IoU of their points.
HOTA: Luiten et al., IJCV 2021. IDF1: Ristani et al., ECCV Workshops 2016.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from automos.core.column_data import ColumnData
from automos.core.geometry import Array
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.evaluation.moving import ratio

Ints = npt.NDArray[np.int64]

NOT_MOVING, NO_TRACK = -1, 0
"""Tracks of points that are not called moving, and of those that are, but on no object."""
STANDS = 0
"""Mover of points whose truth is static."""


@dataclass(frozen=True, eq=False)
class Overlaps(ColumnData):
    """Points by scan, true mover and found track, a row for each of the three that share any; joined over scans.

    Points without truth are in no row, nor are moving ones whose truth names no instance, nor what rightly stands.

    Attributes
    ----------
    scan : (R,) int64
        Index of the scan.
    mover : (R,) int64
        Class and instance id as the truth packs them, the same over time; `STANDS` for static points.
    track : (R,) int64
        Track id, the same over time; `NO_TRACK` or `NOT_MOVING` otherwise.
    n_points : (R,) int64
        How many points.
    """

    scan: Ints
    mover: Ints
    track: Ints
    n_points: Ints

    @classmethod
    def empty(cls) -> Self:
        """Return the table of no scans."""
        return cls(*np.zeros((4, 0), np.int64))

    def total(self, by: tuple[str, ...]) -> tuple[Ints, ...]:
        """Return the distinct values of columns `by`, a column each, in order, and how many points have them."""
        keys = np.stack([getattr(self, name) for name in by])
        found, row = np.unique(keys, axis=1, return_inverse=True)
        return (*found, np.bincount(row.ravel(), self.n_points, found.shape[1]).astype(np.int64))


def count_overlaps(
    scan: int, prediction: npt.ArrayLike, truth: npt.ArrayLike, tracks: npt.ArrayLike | None = None
) -> Overlaps:
    """Return the rows of one scan.

    Parameters
    ----------
    scan : int
        Its index.
    prediction, truth : (N,) integer
        SemanticKITTI labels; the truth's upper 16 bits are the instance.
    tracks : (N,) integer, optional
        Track id of each point that is called moving, 0 for none.
    """
    packed = np.asarray(truth).astype(np.int64)
    true, says_moving = to_mos(packed), to_mos(prediction) == Label.MOVING
    is_mover = (true == Label.MOVING) & (packed >> 16 > 0)
    rows = np.flatnonzero(is_mover | (says_moving & (true == Label.STATIC)))
    mover = np.where(is_mover, packed, STANDS)[rows]
    on = NO_TRACK if tracks is None else np.asarray(tracks).astype(np.int64)
    track = np.where(says_moving, on, NOT_MOVING)[rows]
    pairs, counts = np.unique(np.stack([mover, track]), axis=1, return_counts=True)
    return Overlaps(np.full(len(counts), scan), pairs[0], pairs[1], counts)


def pooled(recordings: Iterable[Overlaps]) -> Overlaps:
    """Return the tables of several recordings as one, in which no scan, mover or track of two is the same."""
    parts = [Overlaps.empty()]
    for n, one in enumerate(recordings):
        own = n << 40  # above the 32 bits of a mover, and any number of scans and tracks
        mover = one.mover + own * (one.mover > STANDS)
        track = one.track + own * (one.track > NO_TRACK)
        parts.append(Overlaps(one.scan + own, mover, track, one.n_points))
    return Overlaps.concatenate(parts)


ALPHAS = np.arange(0.05, 0.99, 0.05)
"""Similarities from which two detections may match, over which HOTA is the mean."""
SAME = 0.5
"""Similarity from which IDF1 counts a track as being on a mover in a scan."""
_EPS = np.finfo(np.float64).eps


@dataclass(frozen=True, eq=False)
class Detections:
    """What the scans hold: of each scan the rows of its movers and tracks, and their similarity (G, T)."""

    n_movers: int
    n_tracks: int
    scans: list[tuple[npt.NDArray, npt.NDArray, Array]]


def hota(found: Detections) -> dict[str, float]:
    """Return HOTA and its parts, detection and association accuracy (DetA, AssA), means over `ALPHAS`, in [0, 1].

    All are nan of a recording in which nothing moves, neither in truth nor by the labels.
    """
    alike = np.zeros((found.n_movers, found.n_tracks))
    of_mover, of_track = np.zeros((found.n_movers, 1)), np.zeros((1, found.n_tracks))
    for movers, tracks, similarity in found.scans:
        total = similarity.sum(axis=0)[None, :] + similarity.sum(axis=1)[:, None] - similarity
        alike[np.ix_(movers, tracks)] += np.divide(similarity, total, out=np.zeros_like(total), where=total > _EPS)
        of_mover[movers, 0] += 1
        of_track[0, tracks] += 1
    alignment = alike / np.maximum(of_mover + of_track - alike, _EPS)
    pairs = []
    for movers, tracks, similarity in found.scans:
        rows, columns = linear_sum_assignment(-alignment[np.ix_(movers, tracks)] * similarity)
        pairs.append(np.stack([movers[rows], tracks[columns], similarity[rows, columns]]))
    mover, track, alikeness = np.concatenate([np.zeros((3, 0)), *pairs], axis=1)
    n_detections, detected, associated = of_mover.sum() + of_track.sum(), [], []
    for alpha in ALPHAS:
        is_match = alikeness >= alpha - _EPS
        (of, by), n = np.unique(np.stack([mover, track])[:, is_match].astype(int), axis=1, return_counts=True)
        together = n / np.maximum(of_mover[of, 0] + of_track[0, by] - n, 1.0)
        detected.append(n.sum() / max(n_detections - n.sum(), 1.0))
        associated.append((n * together).sum() / max(n.sum(), 1.0))
    parts = np.array([np.sqrt(np.multiply(detected, associated)), detected, associated])
    means = parts.mean(axis=1) if found.scans else np.full(3, np.nan)
    return dict(zip(("hota", "det_a", "ass_a"), means.tolist(), strict=True))


def identity(found: Detections) -> dict[str, float]:
    """Return IDF1, in [0, 1]: of movers and tracks paired one to one so that most detections agree; nan of none."""
    agree = np.zeros((found.n_movers, found.n_tracks))
    n_detections = 0
    for movers, tracks, similarity in found.scans:
        agree[np.ix_(movers, tracks)] += similarity >= SAME
        n_detections += len(movers) + len(tracks)
    right = agree[linear_sum_assignment(-agree)].sum()
    return {"idf1": ratio(2.0 * right, n_detections)}


def detections(overlaps: Overlaps) -> Detections:
    """Return each scan's movers and tracks, and the IoU of their points."""
    movers, tracks = (np.unique(column[column > 0]) for column in (overlaps.mover, overlaps.track))
    scans = []
    order = np.argsort(overlaps.scan, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(overlaps.scan[order])) + 1):
        here = overlaps[rows]
        own, found = (np.unique(column[column > 0]) for column in (here.mover, here.track))
        if not len(own) + len(found):
            continue
        shared = np.zeros((len(own) + 1, len(found) + 1))  # the last: points on no mover, on no track
        row = np.where(here.mover > STANDS, np.searchsorted(own, here.mover), len(own))
        column = np.where(here.track > NO_TRACK, np.searchsorted(found, here.track), len(found))
        np.add.at(shared, (row, column), here.n_points)
        both = shared[:-1, :-1]
        union = shared[:-1].sum(axis=1)[:, None] + shared[:, :-1].sum(axis=0)[None, :] - both
        scans.append((np.searchsorted(movers, own), np.searchsorted(tracks, found), both / np.maximum(union, 1.0)))
    return Detections(len(movers), len(tracks), scans)
