"""A map from above, coloured by height; higher points cover lower ones, so moving objects show as trails."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path

_HEIGHTS = (-1.0, 4.0)
"""Metres above the ground under the first scan between which colours differ."""


class HeightPicture:
    """Pixels over the whole drive; each keeps the highest point that fell into it."""

    def __init__(self, low: npt.NDArray, high: npt.NDArray, max_pixels: int):
        """Take the corners (2,) of the area, metres, and how many pixels its longer side may have."""
        self._low = np.asarray(low, np.float64)
        extent = np.asarray(high, np.float64) - self._low
        self._pixel = float(max(extent.max() / max_pixels, 0.02))
        self.heights = np.full(tuple(np.ceil(extent[::-1] / self._pixel).astype(int) + 1), -np.inf, np.float32)

    def add(self, points: npt.NDArray) -> None:
        """Draw `points` (N, 3), metres, level frame."""
        columns, rows = np.floor((points[:, :2] - self._low) / self._pixel).astype(np.int64).T
        inside = (rows >= 0) & (columns >= 0) & (rows < self.heights.shape[0]) & (columns < self.heights.shape[1])
        np.maximum.at(self.heights, (rows[inside], columns[inside]), points[inside, 2].astype(np.float32))

    def write(self, path: Path) -> None:
        """Write the picture as PNG, north up."""
        from matplotlib import colormaps
        from matplotlib.image import imsave

        share = np.clip((self.heights - _HEIGHTS[0]) / (_HEIGHTS[1] - _HEIGHTS[0]), 0.0, 1.0)
        colors = colormaps["turbo"](share, bytes=True)
        colors[~np.isfinite(self.heights)] = (255, 255, 255, 255)
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            imsave(file, np.ascontiguousarray(colors[::-1]), format="png")
