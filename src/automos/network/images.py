"""What the network is given: one scan as a range image with its residuals, made from points and poses."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.scan import Points, Pose
from automos.network.projection import Image, ImageGrid, nearest_points, project
from automos.network.residuals import MAX_RANGE, MIN_RANGE, SPACING, residual_images
from automos.settings import ImageSettings

FORMAT = 2
"""Of networks in files: what their images show. 1: residuals without a sign."""
BASE_CHANNELS = ("range", "x", "y", "z", "intensity")

_ONCE_SETTINGS = {"spacing": SPACING, "residual_min_range": MIN_RANGE, "residual_max_range": MAX_RANGE}
"""What networks of earlier versions hold beside the settings of today."""


@dataclass(frozen=True, eq=False)
class SensorView:
    """How one sensor's scans become images: its beams and the scale of its intensities.

    Attributes
    ----------
    grid : ImageGrid
        Where its beams fall.
    intensity_scale : float
        The intensity that counts as 1; 0 if the sensor measures none.
    """

    grid: ImageGrid
    intensity_scale: float


@dataclass(frozen=True, eq=False)
class Window:
    """A scan and earlier ones, each compensated and in its own sensor frame.

    Attributes
    ----------
    points : (N, 3) float32, metres.
    intensity : (N,) float32 or None.
    past : K earlier clouds (M, 3) float32, None if there is none.
    T_now_past : (K, 4, 4) float64, from each of them to the present one.
    """

    points: Points
    intensity: npt.NDArray[np.float32] | None
    past: tuple[Points | None, ...]
    T_now_past: Pose


@dataclass(frozen=True, eq=False)
class RangeImage:
    """A window as the network sees it, and the way back to points.

    Attributes
    ----------
    channels : (5 + K, H, W) float32
        Range, x, y, z, intensity in [0, 1], residuals; 0 if a pixel is empty.
    index : (H, W) int32
        The point each pixel shows, -1 for none.
    pixels : (N,) int32
        The pixel each point falls into, -1 for none.
    ranges : (N,) float32
        Metres.
    """

    channels: Image
    index: npt.NDArray[np.int32]
    pixels: npt.NDArray[np.int32]
    ranges: npt.NDArray[np.float32]

    @property
    def shown(self) -> npt.NDArray[np.int64]:
        """Rows of the points that are seen, in order: all that later scans need of this one."""
        return np.sort(self.index[self.index >= 0]).astype(np.int64)


def make_image(window: Window, view: SensorView) -> RangeImage:
    """Return the image of `window`."""
    grid = view.grid
    pixels, ranges = project(window.points, grid)
    index = nearest_points(pixels, ranges, grid.size)
    shown = np.flatnonzero(index >= 0)
    rows = index[shown]
    base = np.zeros((len(BASE_CHANNELS), grid.size), np.float32)
    base[0, shown] = ranges[rows]
    base[1:4, shown] = window.points[rows].T
    if window.intensity is not None and view.intensity_scale > 0.0:
        base[4, shown] = np.clip(np.nan_to_num(window.intensity[rows]) / view.intensity_scale, 0.0, 1.0)
    images = base.reshape(-1, grid.height, grid.width)
    residuals = residual_images(images[0], window.past, window.T_now_past, grid)
    return RangeImage(np.concatenate([images, residuals]), index.reshape(grid.height, grid.width), pixels, ranges)


def thin(points: Points, grid: ImageGrid) -> npt.NDArray[np.int64]:
    """Return the rows of the points that are seen in the image, in order: all that earlier scans are needed for."""
    pixels, ranges = project(points, grid)
    index = nearest_points(pixels, ranges, grid.size)
    return np.sort(index[index >= 0]).astype(np.int64)


def read_image_settings(stored: Mapping[str, Any]) -> ImageSettings:
    """Return the settings of the images that a stored network takes.

    Raises
    ------
    ValueError : it was trained on images of another kind.
    """
    settings = dict(stored)
    for name, value in _ONCE_SETTINGS.items():
        if settings.pop(name, value) != value:
            raise ValueError(f"{name} was {stored[name]}, only {value} is possible now")
    return ImageSettings(**settings)
