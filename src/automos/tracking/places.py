"""Static objects beside a mover: places that static points occupied in more scans than moving points.

A pedestrian and the bin that she passes are one segment for a moment, and so are a bus and the shelter at its stop. One
scan cannot separate them: points that "have stayed" may be the bin, or the middle of a tram, whose place the tram
itself occupied shortly before and after. Over the recording, the bin's place is occupied by static points in most
scans, and the tram's by moving points.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.scan import Mask
from automos.upright_boxes import Boxes

Keys = npt.NDArray[np.int64]
SIDE = 0.3
"""Metres, side of a place: smaller ones separate static objects from movers more exactly, until the beams of
neighbouring scans no longer meet the same places."""
OUTNUMBERED = 2
"""A place is static if static points occupied it in more than this many times as many scans as moving points: the
middle of a tram whose track has a gap "has stayed", too, until the tram has passed."""
_COLUMN = 4 * SIDE
"""Metres, side of the columns in which places are counted; only columns in a moving object's box are used."""
_BITS = 21
_FARTHEST = 1 << (_BITS - 1)
_AT_ONCE = 1_000_000
"""Number of places that are collected before they are counted."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places of the level frame that static points have occupied in more scans than moving points.

    Attributes
    ----------
    keys : (P,) int64, sorted.
    is_moving : (T,) bool, tracks that were moving when places were counted; only their points can become static.
    """

    keys: Keys
    is_moving: Mask

    def static_points(self, points: npt.NDArray, track: npt.NDArray[np.int32]) -> Mask:
        """Return (M,) which of `points` (M, 3), of the tracks `track` (M,; -1 for none), are at a static place."""
        stands = np.append(self.is_moving, False)[track]
        mine = np.flatnonzero(stands)
        stands[mine] = _is_among(_packed(*_cells(points[mine], SIDE)), self.keys)
        return stands

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return the arrays for `from_arrays`, for saving."""
        return {"places": self.keys, "places_of": self.is_moving}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> Places:
        """Return the places saved by `to_arrays`."""
        return Places(arrays["places"], arrays["places_of"])


def touched_columns(boxes: Boxes) -> Keys:
    """Return the columns, sorted, that `boxes` may touch in the ground plane at any heading."""
    reach = 0.5 * np.hypot(boxes.size[:, 0], boxes.size[:, 1])[:, None]
    ends = np.hstack([np.floor((boxes.center[:, :2] + side) / _COLUMN) for side in (-reach, reach)]).astype(np.int64)
    parts = [_packed(*np.mgrid[a : c + 1, b : d + 1].reshape(2, -1)) for a, b, c, d in np.unique(ends, axis=0)]
    return np.unique(np.concatenate([np.zeros(0, np.int64), *parts]))


def held_places(points: npt.NDArray, moves: Mask, stays: Mask, columns: Keys) -> tuple[Keys, Keys]:
    """Return the places in `columns` that contain any moving, and any static, of a scan's `points` (M, 3)."""
    inside = np.flatnonzero((moves | stays) & _is_among(_packed(*_cells(points[:, :2], _COLUMN)), columns))
    keys = _packed(*_cells(points[inside], SIDE))
    return np.unique(keys[moves[inside]]), np.unique(keys[stays[inside]])


def count_places(scans: Iterable[tuple[Keys, Keys]]) -> Keys:
    """Return the places, sorted, that moving points occupied, and static points in many more of `scans`.

    scans : per scan, the places of moving and of static points, as `held_places` returns them.
    """
    keys, counts = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    waiting: list[tuple[Keys, Keys]] = []
    for held in scans:
        waiting.append(held)
        if sum(len(part) for pair in waiting for part in pair) > _AT_ONCE:
            keys, counts = _added(keys, counts, waiting)
            waiting = []
    keys, counts = _added(keys, counts, waiting)
    return keys[(counts[:, 0] > 0) & (counts[:, 1] > OUTNUMBERED * counts[:, 0])]


def _added(keys: Keys, counts: Keys, scans: list[tuple[Keys, Keys]]) -> tuple[Keys, Keys]:
    """Return `keys` (P,), sorted, and the numbers of scans in which moving and static points occupied each (P, 2)."""
    parts = [np.concatenate([keys[:0], *(held[k] for held in scans)]) for k in (0, 1)]
    found, where = np.unique(np.concatenate([keys, *parts]), return_inverse=True)
    before, *held = np.split(where, np.cumsum([len(keys), len(parts[0])]))
    total = np.stack([np.bincount(rows, minlength=len(found)) for rows in held], axis=1)
    total[before] += counts
    return found, total


def _cells(points: npt.NDArray, side: float) -> Keys:
    """Return (D, M) the cell of `side` metres of each of `points` (M, D) along each axis."""
    return np.floor(points.T / np.float64(side)).clip(-_FARTHEST, _FARTHEST - 1).astype(np.int64)


def _packed(x: Keys, y: Keys, z: Keys | int = 0) -> Keys:
    """Return (M,) int64 one non-negative key for the cells along all axes."""
    return ((x + _FARTHEST) << 2 * _BITS) | ((y + _FARTHEST) << _BITS) | (z + _FARTHEST)


def _is_among(keys: Keys, wanted: Keys) -> Mask:
    """Return (M,) which of `keys` are among `wanted` (P,), sorted."""
    if len(wanted) == 0:
        return np.zeros(len(keys), np.bool_)
    return wanted[np.minimum(np.searchsorted(wanted, keys), len(wanted) - 1)] == keys
