"""Voxels of a map in square tiles, of which only those near the sensor are in memory.

A tile out of the sensor's range is complete and can be written, so memory does not grow with the drive. A place that is
visited again later is another tile, so a few of its voxels are written twice.
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from automos.core.voxels import VoxelMap

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

    def __init__(self, voxel: float, origin: npt.NDArray, n_marks: int):
        """Take the voxels' edge, the tile's corner (3,) in metres, and how many marks a point may bear."""
        self.voxels = VoxelMap(voxel, origin)
        self._marks = np.zeros((0, n_marks), np.int64)

    @property
    def marks(self) -> npt.NDArray[np.int64]:
        """(V, K), see above."""
        return self._marks[: len(self.voxels)]

    def add(self, points: npt.NDArray, marks: npt.NDArray) -> None:
        """Add `points` (N, 3), metres, that has `marks` (N, K) bool."""
        ids = self.voxels.add(points)
        if len(self.voxels) > len(self._marks):
            more = np.zeros((max(len(self.voxels), 2 * len(self._marks)) - len(self._marks), marks.shape[1]), np.int64)
            self._marks = np.concatenate([self._marks, more])
        for k in range(marks.shape[1]):
            self._marks[:, k] += np.bincount(ids, marks[:, k], len(self._marks)).astype(np.int64)


class Tiles:
    """The tiles within the sensor's range."""

    def __init__(self, voxel: float, side: float, n_marks: int = 0):
        """Take the edges of voxels and tiles, metres; a tile's is rounded to whole voxels."""
        self._voxel, self._n_marks = voxel, n_marks
        self._side = max(round(side / voxel), 1) * voxel
        self._tiles: dict[tuple[int, int], Tile] = {}

    def __len__(self) -> int:
        return len(self._tiles)

    def add(self, points: npt.NDArray, marks: npt.NDArray | None = None) -> None:
        """Add `points` (N, 3), metres, level frame, and the marks (N, K) bool they bear."""
        if marks is None:
            marks = np.zeros((len(points), 0), bool)
        column, line = np.floor(points[:, :2] / self._side).astype(np.int64).T
        keys, tile_of = np.unique(
            column * _STRIDE + line, return_inverse=True
        )  # one number is quicker to sort than two
        for row, key in enumerate(keys.tolist()):
            place = ((key + _STRIDE // 2) // _STRIDE, (key + _STRIDE // 2) % _STRIDE - _STRIDE // 2)
            if place not in self._tiles:
                corner = np.array([place[0] * self._side, place[1] * self._side, 0.0])
                self._tiles[place] = Tile(self._voxel, corner, self._n_marks)
            is_here = tile_of == row
            self._tiles[place].add(points[is_here], marks[is_here])

    def leave(self, origin: npt.NDArray, reach: float) -> Iterator[Tile]:
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
