"""Metrics of a cleaned map: how much of the static world it keeps, and how much of the moving points it removes.

Preservation and rejection rate (Lim et al., ERASOR): of the 0.2 m voxels with truly static points, the share that still
has a point; of the voxels with truly moving points only, the share that has none. F1 is their harmonic mean. Static,
dynamic and associated accuracy (Zhang et al., DynamicMap): SA, the share of static points kept; DA, the share of moving
points removed; AA, the square root of their product. Points without ground truth do not count.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from automos.core.scan import Mask
from automos.writers.maps.tiles import TILE, Tile, Tiles


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


@dataclass
class MapCounts:
    """Counts over scans; memory is that of the tiles in the sensor's range."""

    voxel: float = 0.2
    tile: float = TILE
    static: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))  # points: all, kept
    moving: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))
    static_voxels: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))
    moving_voxels: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))

    def __post_init__(self) -> None:
        self._tiles = Tiles(self.voxel, self.tile, n_marks=3)

    def add(self, points: npt.NDArray, is_static: Mask, is_moving: Mask, is_kept: Mask) -> None:
        """Count `points` (N, 3), metres, level frame: static or moving by the truth, kept or not in the map."""
        for counts, is_such in ((self.static, is_static), (self.moving, is_moving)):
            counts += (int(is_such.sum()), int((is_such & is_kept).sum()))
        is_known = is_static | is_moving
        self._tiles.add(points[is_known], np.stack([is_static, is_moving, is_kept], axis=1)[is_known])

    def leave(self, origin: npt.NDArray, reach: float) -> None:
        """Finish the tiles further than `reach` (metres) from `origin`."""
        for tile in self._tiles.leave(origin, reach):
            self._finish(tile)

    def scores(self) -> MapScores:
        """Return the scores of everything added; nothing may be added afterwards."""
        for tile in self._tiles.rest():
            self._finish(tile)
        return MapScores(
            _share(self.static_voxels[1], self.static_voxels[0]),
            1.0 - _share(self.moving_voxels[1], self.moving_voxels[0]),
            _share(self.static[1], self.static[0]),
            1.0 - _share(self.moving[1], self.moving[0]),
        )

    def _finish(self, tile: Tile) -> None:
        n_static, _, n_kept = tile.marks.T
        for counts, is_such in ((self.static_voxels, n_static > 0), (self.moving_voxels, n_static == 0)):
            counts += (int(is_such.sum()), int((is_such & (n_kept > 0)).sum()))


def _share(part: int, whole: int) -> float:
    return float(part / whole) if whole else float("nan")
