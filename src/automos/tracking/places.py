"""What stands beside a mover: places that what stays has held in more scans than what moves.

A walker and the bin that she passes are one segment for as long as she passes it, and so are a bus and the shelter it
stops at. In one scan nothing tells them apart: points that "have stayed" may be the bin, or the middle of a tram, whose
place the tram held itself a moment before and a moment after. Over the recording the bin's place is held by what stays
in most scans, and the tram's by what moves.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.cells import whole_below
from automos.kernels import kernel
from automos.upright_boxes import Boxes

SIDE = 0.3
"""Metres, side of a place: a smaller one parts what stands from what passes it more exactly, until the beams of
neighbouring scans no longer meet the same ones."""
OUTNUMBERED = 2
"""A place is static if what stays held it in more than so many times as many scans as what moves: of a tram that is not
followed for a while the middle "has stayed", too, for as long as it takes to go by."""
_COLUMN = 4
"""Places along the side of the columns in which places are counted: those that a moving object's box has touched."""
_BITS = 21
_OFFSET, _MASK = 1 << (_BITS - 1), (1 << _BITS) - 1
_AT_ONCE = 1_000_000
"""Places that wait before they are added up."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places of the level frame that what stays has held in more scans than what moves.

    Attributes
    ----------
    keys : (P,) int64, sorted.
    is_moving : (T,) bool, which tracks were taken for movers when it was counted; places are taken from no others.
    """

    keys: npt.NDArray[np.int64]
    is_moving: npt.NDArray[np.bool_]

    def static_points(self, points: npt.NDArray, track: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
        """Return (M,) which of `points` (M, 3) of the tracks `track` (M,), -1 for none, are what stands beside them."""
        stands = np.append(self.is_moving, False)[track]
        mine = np.flatnonzero(stands)
        stands[mine] = np.isin(_keys(points[mine]), self.keys)
        return stands

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return what `from_arrays` takes, for saving."""
        return {"places": self.keys, "places_of": self.is_moving}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> Places:
        """Return the places that `to_arrays` took apart."""
        return Places(arrays["places"], arrays["places_of"])


def touched_columns(boxes: Boxes) -> npt.NDArray[np.int64]:
    """Return the columns, sorted, that `boxes` reach into, seen from above and however they are turned."""
    reach = 0.5 * np.hypot(boxes.size[:, 0], boxes.size[:, 1])[:, None]
    low, high = (np.floor((boxes.center[:, :2] + side) / (_COLUMN * SIDE)).astype(np.int64) for side in (-reach, reach))
    columns = np.empty(int((high - low + 1).prod(axis=1).sum()), np.int64)
    _fill_columns(low, high, columns)
    return np.unique(columns)


def held_places(
    points: npt.NDArray, moves: npt.NDArray[np.bool_], stays: npt.NDArray[np.bool_], columns: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the places in `columns` that hold any of a scan's `points` (M, 3) that move, and any that stay."""
    keys = _keys_inside(points, columns)
    return np.unique(keys[(keys >= 0) & moves]), np.unique(keys[(keys >= 0) & stays])


def count_places(scans: Iterable[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]) -> npt.NDArray[np.int64]:
    """Return the places, sorted, of those that anything moving held, that what stays has held in many more of `scans`.

    scans : per scan, the places that moving points held, and those that stay, as `held_places` returns them.
    """
    keys, counts = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    waiting: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]] = []
    for held in scans:
        waiting.append(held)
        if sum(len(part) for pair in waiting for part in pair) > _AT_ONCE:
            keys, counts = _added(keys, counts, waiting)
            waiting = []
    keys, counts = _added(keys, counts, waiting)
    return keys[(counts[:, 0] > 0) & (counts[:, 1] > OUTNUMBERED * counts[:, 0])]


def _added(
    keys: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    scans: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return `keys` (P,), sorted, and in how many scans each was held by what moves and by what stays (P, 2)."""
    parts = [np.concatenate([held[k] for held in scans] or [keys[:0]]) for k in (0, 1)]
    found, where = np.unique(np.concatenate([keys, *parts]), return_inverse=True)
    before, moved, stayed = np.split(where, np.cumsum([len(keys), len(parts[0])]))
    total = np.zeros((len(found), 2), np.int64)
    total[before] = counts
    np.add.at(total[:, 0], moved, 1)
    np.add.at(total[:, 1], stayed, 1)
    return found, total


@kernel
def _packed(x, y, z):  # type: ignore[no-untyped-def]
    return (((x + _OFFSET) & _MASK) << (2 * _BITS)) | (((y + _OFFSET) & _MASK) << _BITS) | ((z + _OFFSET) & _MASK)


@kernel
def _fill_columns(low, high, columns):  # type: ignore[no-untyped-def]
    """Write all columns between the corners `low` and `high` (M, 2), those of the corners included."""
    n = 0
    for b in range(len(low)):
        for x in range(low[b, 0], high[b, 0] + 1):
            for y in range(low[b, 1], high[b, 1] + 1):
                columns[n] = _packed(x, y, 0)
                n += 1


@kernel
def _keys(points):  # type: ignore[no-untyped-def]
    """Return (M,) int64 the place of each point, never negative."""
    keys = np.empty(len(points), np.int64)
    for i in range(len(points)):
        x, y, z = points[i, 0] / SIDE, points[i, 1] / SIDE, points[i, 2] / SIDE
        keys[i] = _packed(whole_below(x), whole_below(y), whole_below(z))
    return keys


@kernel
def _keys_inside(points, columns):  # type: ignore[no-untyped-def]
    """Return (M,) int64 the place of each point in `columns`, sorted; -1 outside. Neighbours share a column mostly."""
    keys, side = _keys(points), _COLUMN * SIDE
    last, is_inside = np.int64(-1), False
    for i in range(len(points)):
        column = _packed(whole_below(points[i, 0] / side), whole_below(points[i, 1] / side), 0)
        if column != last:
            k = np.searchsorted(columns, column)
            is_inside, last = k < len(columns) and columns[k] == column, column
        if not is_inside:
            keys[i] = -1
    return keys
