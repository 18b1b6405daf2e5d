"""A yard with exact truth of every point: who it lies on, seen by one spinning sensor that drives through."""

from collections.abc import Sequence

import numpy as np
from worlds import Block, cast

from automos.core.geometry import make_transform
from automos.core.scan import Frame

GROUND = -1
WALLS = (
    Block((0.0, 18.0, 2.5), (50.0, 1.0, 5.0)),
    Block((0.0, -14.0, 2.5), (50.0, 1.0, 5.0)),
    Block((24.0, 0.0, 2.5), (1.0, 34.0, 5.0)),
    Block((-24.0, 0.0, 2.5), (1.0, 34.0, 5.0)),
)
PARKED = Block((10.0, -6.0, 0.9), (4.4, 1.8, 1.8))
HIDDEN = Block((5.0, 13.0, 1.5), (7.0, 0.5, 3.0))
"""A wall that the mover passes before."""
MOVER = Block((-14.0, 8.0, 1.0), (3.5, 1.6, 2.0), 0.0, (8.0, 0.0, 0.0))
"""Goes by beside the sensor's way, from behind it to before it, in three and a half seconds."""
YARD = (*WALLS, PARKED, HIDDEN, MOVER)


class Yard:
    """Frames at 10 Hz of a sensor that drives along x at 2 m/s, and of each point the block of `YARD` it lies on."""

    def __init__(self, blocks: Sequence[Block] = YARD, n_scans: int = 36, n_beams: int = 40, n_columns: int = 600):
        azimuth = 2.0 * np.pi * (np.arange(n_columns) + 0.5) / n_columns
        elevation = np.radians(np.linspace(-24.0, 6.0, n_beams))
        e, a = (grid.ravel() for grid in np.meshgrid(elevation, azimuth))
        rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
        rng = np.random.default_rng(0)
        self._frames, self.block = [], []
        for i in range(n_scans):
            T = make_transform(None, [0.2 * i - 3.0, 0.0, 1.8])
            distance, hit = cast(blocks, T[:3, 3], rays, 0.1 * i)
            seen = np.flatnonzero(distance < 60.0)
            points = ((distance[seen] + rng.normal(0.0, 0.01, len(seen)))[:, None] * rays[seen]).astype(np.float32)
            self._frames.append(Frame(points, np.arange(len(points)), len(points), T, 0.1 * i))
            self.block.append(hit[seen])
        self.stamps = 0.1 * np.arange(n_scans)
        self.T_level_sensor = np.stack([frame.T_level_sensor for frame in self._frames])

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Frame:
        return self._frames[index]

    def of(self, scan: int, *blocks: Block) -> np.ndarray:
        """Return (M,) bool: which points of a scan of `YARD` lie on any of `blocks`."""
        return np.isin(self.block[scan], [YARD.index(block) for block in blocks])
