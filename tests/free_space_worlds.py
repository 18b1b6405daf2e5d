"""Frames of tiny worlds for the tests of free space: one spinning sensor, blocks on a plane."""

from collections.abc import Callable, Sequence

import numpy as np
from worlds import Block, cast

from automos.core.geometry import make_transform
from automos.core.scan import Frame

HEIGHT = 1.8  # m, of the sensor
REACH = 70.0  # m


class ListFrames:
    """Frames in memory, as the stages take them."""

    def __init__(self, frames: Sequence[Frame]):
        self._frames = list(frames)
        self.T_level_sensor = np.stack([frame.T_level_sensor for frame in frames])

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Frame:
        return self._frames[index]

    @property
    def stamps(self) -> np.ndarray:
        return np.array([frame.stamp for frame in self._frames])


def spin(
    blocks: Sequence[Block],
    x: float = 0.0,
    time: float = 0.0,
    R_level_sensor: np.ndarray | None = None,
    n_beams: int = 32,
    n_columns: int = 720,
) -> tuple[Callable[[np.ndarray], Frame], np.ndarray, np.ndarray]:
    """Return what a sensor at (x, 0) sees: a maker of the frame from ranges, the rays (R, 3), their ranges (R,)."""
    azimuth = 2.0 * np.pi * (np.arange(n_columns) + 0.5) / n_columns
    elevation = np.radians(np.linspace(-24.0, 6.0, n_beams))
    e, a = (grid.ravel() for grid in np.meshgrid(elevation, azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    T = make_transform(R_level_sensor, [x, 0.0, HEIGHT])
    distance, _ = cast(blocks, T[:3, 3], rays @ T[:3, :3].T, time)

    def frame(ranges: np.ndarray) -> Frame:
        noise = np.random.default_rng(int(1000 * time)).normal(0.0, 0.01, len(ranges))
        seen = np.flatnonzero(ranges < REACH)
        points = ((ranges + noise)[seen, None] * rays[seen]).astype(np.float32)
        return Frame(points, np.arange(len(points)), len(points), T, time)

    return frame, rays, distance


def watch(
    blocks: Sequence[Block],
    n_scans: int = 40,
    speed: float = 2.0,
    R_level_sensor: np.ndarray | None = None,
    shown: Callable[[float], Sequence[Block]] = lambda time: (),
    n_beams: int = 32,
) -> ListFrames:
    """Return `n_scans` frames at 10 Hz of a sensor driving along x; `shown` gives further blocks at a time."""
    frames = []
    for i in range(n_scans):
        frame, _, distance = spin((*blocks, *shown(0.1 * i)), 0.1 * speed * i, 0.1 * i, R_level_sensor, n_beams)
        frames.append(frame(distance))
    return ListFrames(frames)


def within(frame: Frame, block: Block, time: float = 0.0, margin: float = 0.1) -> np.ndarray:
    """Return (M,) bool: which of the frame's points lie on `block` at `time`, its foot left out."""
    offset = frame.points_level - (np.asarray(block.center) + time * np.asarray(block.velocity))
    c, s = np.cos(block.yaw), np.sin(block.yaw)
    local = np.abs(np.stack([c * offset[:, 0] + s * offset[:, 1], c * offset[:, 1] - s * offset[:, 0]], axis=1))
    half = 0.5 * np.asarray(block.size)
    is_high = (frame.points_level[:, 2] > 0.3) & (np.abs(offset[:, 2]) < half[2] + margin)
    return (local < half[:2] + margin).all(axis=1) & is_high
