"""Sweeps of a VLP-16 in a room where someone walks, as the packets it would send. For tests only."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "readers"))

from velodyne_packets import ELEVATIONS, data_packets, firings

PERIOD = 0.1
N_SWEEPS = 6


def room_packets(n_sweeps: int = N_SWEEPS, speed: float = 2.0) -> list[tuple[float, bytes]]:
    """Return (seconds, payload) of a VLP-16 that stands in a room of 16 x 10 m; a pillar walks by at `speed` m/s."""
    n = int(n_sweeps * PERIOD / 55.296e-6) // 24 * 24
    azimuth, times = firings(n, period=PERIOD)
    a = np.radians(azimuth)
    direction = np.cos(a), -np.sin(a)
    with np.errstate(divide="ignore"):
        wall = np.minimum(8.0 / np.abs(direction[0]), 5.0 / np.abs(direction[1]))
    elevation = np.radians(ELEVATIONS)
    with np.errstate(divide="ignore"):
        floor = np.where(elevation < 0, 1.5 / np.tan(-elevation), np.inf)
    level = np.minimum(wall, floor)
    middle = np.stack([np.full_like(times, 4.0), -3.0 + speed * times], axis=-1)  # of the pillar
    along = middle[..., 0] * direction[0] + middle[..., 1] * direction[1]
    off = np.hypot(middle[..., 0], middle[..., 1]) ** 2 - along**2
    is_hit = (off < 0.3**2) & (along > 0) & (along < level)
    level = np.where(is_hit, along, level)
    strength = np.full(level.shape, 40, np.uint8)
    return data_packets(level / np.cos(elevation), strength, azimuth, start=100.0)
