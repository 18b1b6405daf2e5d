"""The result of tracking: one row for every object in every scan of its track."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain, pairwise

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.upright_boxes import Boxes

AT_ONCE = 100
"""Scans after which tables are joined, and what was freed goes back: small arrays lie scattered over all of it."""


@dataclass(frozen=True, eq=False)
class Tracks(ColumnData):
    """Tracks as a flat table, sorted by track, then scan.

    Attributes
    ----------
    track : (R,) int64, 0.. without gaps.
    scan : (R,) int64, index of the scan.
    segment : (R,) int64, associated segment of that scan, -1 where the object was missed.
    center, size, yaw : (R, 3), (R, 3), (R,) float64, estimated box, level frame, metres and radians.
    velocity : (R, 3) float64, metres per second, level frame.
    p_moving : (R,) float64, probability that the object moves in that scan; 0 if not given.
    """

    track: npt.NDArray[np.int64]
    scan: npt.NDArray[np.int64]
    segment: npt.NDArray[np.int64]
    center: npt.NDArray[np.float64]
    size: npt.NDArray[np.float64]
    yaw: npt.NDArray[np.float64]
    velocity: npt.NDArray[np.float64]
    p_moving: npt.NDArray[np.float64] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.p_moving is None:
            object.__setattr__(self, "p_moving", np.zeros(len(self.track)))

    def __len__(self) -> int:
        return int(self.track[-1]) + 1 if len(self.track) else 0

    def __repr__(self) -> str:
        return f"<Tracks: {len(self)} objects in {len(self.track)} boxes>"

    @classmethod
    def concatenate(cls, parts: Iterable[Tracks]) -> Tracks:
        """Return the rows of all `parts`, sorted by track, then scan."""
        none, nowhere = np.zeros(0, np.int64), np.zeros((0, 3))
        columns: list[list[npt.NDArray]] = [[] for _ in fields(cls)]
        for part in chain([cls(none, none, none, nowhere, nowhere, np.zeros(0), nowhere)], parts):
            for column, f in zip(columns, fields(cls), strict=True):
                column.append(getattr(part, f.name))
                if len(column) > AT_ONCE:  # thousands of small arrays lie scattered between what is freed
                    column[:] = [np.concatenate(column)]
        rows = np.lexsort((np.concatenate(columns[1]), np.concatenate(columns[0])))
        return cls(*(np.concatenate(columns.pop(0))[rows] for _ in fields(cls)))  # a column at a time is there twice

    @classmethod
    def of_segments(cls, track: npt.NDArray, scan: npt.NDArray, segment: npt.NDArray, p_moving: npt.NDArray) -> Tracks:
        """Return rows of which the boxes are not known."""
        nowhere = np.zeros((len(track), 3))
        return cls(track, scan, segment, nowhere, nowhere, np.zeros(len(track)), nowhere, p_moving)

    @property
    def is_observed(self) -> npt.NDArray[np.bool_]:
        """(R,) whether a segment was associated in that scan."""
        return self.segment >= 0

    @property
    def boxes(self) -> Boxes:
        """The boxes of all rows."""
        return Boxes(self.center, self.size, self.yaw, np.ones(len(self.track)))

    def rows_by_scan(self, n_scans: int) -> list[npt.NDArray[np.int64]]:
        """Return the rows (K,) of the tracks in each of `n_scans`, in order."""
        order, scan = self._by_scan
        bounds = np.searchsorted(scan, np.arange(n_scans + 1)).tolist()
        return [order[begin:end] for begin, end in pairwise(bounds)]  # np.split takes longer than sorting

    def rows_in_scan(self, index: int) -> npt.NDArray[np.int64]:
        """Return the rows (K,) of the tracks in scan `index`, in order."""
        order, scan = self._by_scan
        begin, end = np.searchsorted(scan, (index, index + 1))
        return order[begin:end]

    @cached_property
    def _by_scan(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        order = np.argsort(self.scan, kind="stable")
        return order, self.scan[order]

    def first_rows(self) -> npt.NDArray[np.int64]:
        """Return (T,) the first row of each track."""
        return np.searchsorted(self.track, np.arange(len(self)))

    def first_of_sights(self) -> npt.NDArray[np.int64]:
        """Return (S,) the first row of each sight: the rows of a track in scans without a break between them."""
        return np.flatnonzero((np.diff(self.track, prepend=-1) != 0) | (np.diff(self.scan, prepend=-1) > 1))

    def rows_of(self, track: int) -> slice:
        """Return the rows of one track."""
        return slice(int(np.searchsorted(self.track, track)), int(np.searchsorted(self.track, track, side="right")))


def without_gaps(tracks: Tracks) -> Tracks:
    """Return `tracks` with a row for every scan from the first to the last one of each, where it was missed, too."""
    skipped = np.where(np.diff(tracks.track) == 0, np.diff(tracks.scan) - 1, 0)
    before = np.repeat(np.arange(len(skipped)), skipped)
    scan = tracks.scan[before] + counted(skipped)
    missed = replace(tracks[before], scan=scan, segment=np.full(len(before), -1))
    return Tracks.concatenate([tracks, missed]) if len(before) else tracks


def counted(n: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return 1, 2, ... up to each of the numbers `n` (K,), one after the other."""
    return np.arange(1, n.sum() + 1) - np.repeat(np.cumsum(n) - n, n)


def observed(tracks: Tracks) -> Tracks:
    """Return the rows with a segment."""
    return tracks[np.flatnonzero(tracks.is_observed)]


def of_tracks(tracks: Tracks, is_kept: npt.NDArray[np.bool_]) -> Tracks:
    """Return the rows of the tracks that are kept (T,), numbered anew."""
    kept = tracks[np.flatnonzero(is_kept[tracks.track])]
    return replace(kept, track=(np.cumsum(is_kept) - 1)[kept.track])


def of_rows(segment: npt.NDArray[np.int64], column: npt.NDArray) -> npt.NDArray:
    """Return (R, ...) what `column` (M, ...) says of the segment of each row (R,), NaN where that is -1."""
    return np.concatenate([column, np.full((1, *column.shape[1:]), np.nan)])[segment]
