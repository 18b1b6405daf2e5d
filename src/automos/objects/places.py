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

from automos.core.scan import Mask
from automos.core.upright_boxes import Boxes
from automos.core.voxels import BITS

Keys = npt.NDArray[np.int64]
SIDE = 0.3
"""Metres, side of a place: smaller ones separate static objects from movers more exactly, until the beams of
neighbouring scans no longer meet the same places."""
OUTNUMBERED = 2
"""A place is static if static points occupied it in more than this many times as many scans as moving points: the
middle of a tram whose track has a gap "has stayed", too, until the tram has passed."""
_COLUMN = 4 * SIDE  # metres, side of the columns in which places are counted: only those in a moving object's box
_FARTHEST = 1 << (BITS - 1)
_AT_ONCE = 250_000  # places that are collected before they are counted


@dataclass(frozen=True, eq=False)
class Places:
    """Places of the level frame that static points have occupied in more scans than moving points.

    `keys` (P,) are sorted. `is_moving` (T,) are the tracks that were moving when places were counted; only their points
    can become static.
    """

    keys: Keys
    is_moving: Mask

    def static_points(self, points: npt.NDArray, track: npt.NDArray[np.int32]) -> Mask:
        """Return (M,) which of `points` (M, 3), of the tracks `track` (M,; -1 for none), are at a static place."""
        stands = np.append(self.is_moving, False)[track]
        mine = np.flatnonzero(stands)
        stands[mine] = _is_among(_keys(points[mine], SIDE), self.keys)
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


def held_places(points: npt.NDArray, moves: Mask, stays: Mask, columns: Keys) -> tuple[Keys, Mask]:
    """Return the places (P,) in `columns` that a scan's `points` (M, 3) occupy, and which by moving and static ones."""
    inside = np.flatnonzero((moves | stays) & _is_among(_keys(points[:, :2], _COLUMN), columns))
    keys, place = np.unique(_keys(points[inside], SIDE), return_inverse=True)
    held = [np.bincount(place, kind[inside], len(keys)) > 0.0 for kind in (moves, stays)]
    return keys, np.stack(held, axis=1)


def count_places(scans: Iterable[tuple[Keys, Mask]]) -> Keys:
    """Return the places, sorted, that moving points occupied in `scans`, and static points in many more of them."""
    counted: list[tuple[Keys, npt.NDArray]] = [(np.zeros(0, np.int64), np.zeros((0, 2), np.int32))]
    for held in scans:
        counted.append(held)
        if sum(len(keys) for keys, _ in counted[1:]) > _AT_ONCE:
            counted = [_added(counted)]
    keys, counts = _added(counted)
    return keys[(counts[:, 0] > 0) & (counts[:, 1] > OUTNUMBERED * counts[:, 0])]


def _added(counted: list[tuple[Keys, npt.NDArray]]) -> tuple[Keys, npt.NDArray]:
    """Return all places, sorted, and the numbers of scans (P, 2) in which moving and static points occupied each."""
    keys, place = np.unique(np.concatenate([keys for keys, _ in counted]), return_inverse=True)
    counts = np.concatenate([counts for _, counts in counted])
    return keys, np.stack([np.bincount(place, kind, len(keys)).astype(np.int32) for kind in counts.T], axis=1)


def _keys(points: npt.NDArray, side: float) -> Keys:
    """Return (M,) the key of the cell of `side` metres, along two or three axes, of each of `points` (M, 2 or 3)."""
    return _packed(*np.floor(points.T / np.float64(side)).clip(-_FARTHEST, _FARTHEST - 1).astype(np.int64))


def _packed(x: Keys, y: Keys, z: Keys | int = 0) -> Keys:
    """Return (M,) int64 one non-negative key for the cells along all axes."""
    return ((x + _FARTHEST) << 2 * BITS) | ((y + _FARTHEST) << BITS) | (z + _FARTHEST)


def _is_among(keys: Keys, wanted: Keys) -> Mask:
    """Return (M,) which of `keys` are among `wanted` (P,), sorted."""
    if len(wanted) == 0:
        return np.zeros(len(keys), np.bool_)
    return wanted[np.minimum(np.searchsorted(wanted, keys), len(wanted) - 1)] == keys
