"""Points that true movers and found tracks share, scan by scan: the table from which all measures of objects follow."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.labels import Label, to_mos

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
        mover = np.where(one.mover > STANDS, one.mover + own, one.mover)
        parts.append(
            Overlaps(one.scan + own, mover, np.where(one.track > NO_TRACK, one.track + own, one.track), one.n_points)
        )
    return Overlaps.concatenate(parts)
