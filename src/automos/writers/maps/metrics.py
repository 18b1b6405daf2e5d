"""Metrics of a cleaned map: how much of the static world it keeps, and how much of the moving points it removes.

Preservation and rejection rate (Lim et al., ERASOR): of the 0.2 m voxels with truly static points, the share that still
has a point; of the voxels with truly moving points only, the share that has none. F1 is their harmonic mean. Static,
dynamic and associated accuracy (Zhang et al., DynamicMap): SA, the share of static points kept; DA, the share of moving
points removed; AA, the square root of their product. Points without ground truth do not count.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from automos.core.scan import Ints, Mask
from automos.core.voxel_map import VoxelMap
from automos.evaluation.moving import ratio

_STRIDE = 1 << 32

TILE = 40.0
"""Metres, side of a tile: a small part of what the sensor reaches, so that few wait, and large against a voxel."""


class Tile:
    """The voxels of one square of ground.

    Attributes
    ----------
    voxels : their means.
    marks : (V, K) int64, how many of the points in each voxel bore each of K marks.
    """

    def __init__(self, voxel: float, origin: np.ndarray, n_marks: int):
        """Take the voxels' edge, the tile's corner (3,) in metres, and how many marks a point may bear."""
        self.voxels = VoxelMap(voxel, origin)
        self.marks: Ints = np.zeros((0, n_marks), np.int64)

    def add(self, points: np.ndarray, marks: np.ndarray) -> None:
        """Add `points` (N, 3), metres, that has `marks` (N, K) bool."""
        ids = self.voxels.add(points)
        self.marks = np.pad(self.marks, ((0, len(self.voxels) - len(self.marks)), (0, 0)))
        for k, mark in enumerate(marks.T):
            self.marks[:, k] += np.bincount(ids, mark, len(self.marks)).astype(np.int64)


class Tiles:
    """The tiles within the sensor's range."""

    def __init__(self, voxel: float, side: float, n_marks: int = 0):
        """Take the edges of voxels and tiles, metres; a tile's is rounded to whole voxels."""
        self._voxel, self._n_marks = voxel, n_marks
        self._side = max(round(side / voxel), 1) * voxel
        self._tiles: dict[tuple[int, int], Tile] = {}

    def __len__(self) -> int:
        return len(self._tiles)

    def add(self, points: np.ndarray, marks: np.ndarray | None = None) -> None:
        """Add `points` (N, 3), metres, level frame, and the marks (N, K) bool they bear."""
        if marks is None:
            marks = np.zeros((len(points), 0), bool)
        column, line = np.floor(points[:, :2] / self._side).astype(np.int64).T
        one_number = column * _STRIDE + line  # quicker to sort than two
        _, first, tile_of = np.unique(one_number, return_index=True, return_inverse=True)
        for row, place in enumerate(zip(column[first].tolist(), line[first].tolist(), strict=True)):
            if place not in self._tiles:
                corner = np.array([place[0] * self._side, place[1] * self._side, 0.0])
                self._tiles[place] = Tile(self._voxel, corner, self._n_marks)
            is_here = tile_of == row
            self._tiles[place].add(points[is_here], marks[is_here])

    def leave(self, origin: np.ndarray, reach: float) -> Iterator[Tile]:
        """Remove and yield the tiles that are completely further than `reach` (metres) from `origin` (2 or 3,)."""
        for place in list(self._tiles):
            low = np.array(place) * self._side
            away = np.maximum(np.maximum(low - origin[:2], origin[:2] - low - self._side), 0.0)
            if np.hypot(*away) > reach:
                yield self._tiles.pop(place)

    def rest(self) -> Iterator[Tile]:
        """Yield all remaining tiles."""
        while self._tiles:
            yield self._tiles.pop(next(iter(self._tiles)))


@dataclass(frozen=True)
class MapScores:
    """Shares in [0, 1], nan if there is nothing to count: PR, RR and F1 of voxels, SA, DA and AA of points."""

    preservation: float
    rejection: float
    static_accuracy: float
    dynamic_accuracy: float

    @property
    def f1(self) -> float:
        """Harmonic mean of preservation and rejection rate."""
        total = self.preservation + self.rejection
        return 2.0 * self.preservation * self.rejection / total if total > 0.0 else float("nan")

    @property
    def associated_accuracy(self) -> float:
        """Geometric mean of static and dynamic accuracy."""
        return float(np.sqrt(self.static_accuracy * self.dynamic_accuracy))


class MapCounts:
    """Counts over scans; memory is that of the tiles in the sensor's range.

    Attributes
    ----------
    points, voxels : (2, 2) int64, of static and of moving ones: all, and those kept.
    """

    def __init__(self, voxel: float = 0.2, tile: float = TILE):
        """Take the edges of voxels and tiles, metres."""
        self.points, self.voxels = np.zeros((2, 2, 2), np.int64)
        self._tiles = Tiles(voxel, tile, n_marks=3)

    def add(self, points: np.ndarray, is_static: Mask, is_moving: Mask, is_kept: Mask) -> None:
        """Count `points` (N, 3), metres, level frame: static or moving by the truth, kept or not in the map."""
        self.points += [_kept_of(is_static, is_kept), _kept_of(is_moving, is_kept)]
        is_known = is_static | is_moving
        self._tiles.add(points[is_known], np.stack([is_static, is_moving, is_kept], axis=1)[is_known])

    def leave(self, origin: np.ndarray, reach: float) -> None:
        """Finish the tiles further than `reach` (metres) from `origin`."""
        for tile in self._tiles.leave(origin, reach):
            self._finish(tile)

    def scores(self) -> MapScores:
        """Return the scores of everything added; nothing may be added afterwards."""
        for tile in self._tiles.rest():
            self._finish(tile)
        voxels, points = ([ratio(kept, total) for total, kept in counts] for counts in (self.voxels, self.points))
        return MapScores(voxels[0], 1.0 - voxels[1], points[0], 1.0 - points[1])

    def _finish(self, tile: Tile) -> None:
        n_static, _, n_kept = tile.marks.T
        self.voxels += [_kept_of(n_static > 0, n_kept > 0), _kept_of(n_static == 0, n_kept > 0)]


def _kept_of(is_such: Mask, is_kept: Mask) -> tuple[int, int]:
    """Return how many there are of a kind, and how many of these are kept."""
    return int(np.count_nonzero(is_such)), int(np.count_nonzero(is_such & is_kept))
