"""What the network is given: one scan as a range image with its residuals, made from points and poses."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.scan import Points, Pose
from automos.network.projection import Image, ImageGrid, nearest_points, project
from automos.network.residuals import residual_images

FORMAT = 3
"""Of networks in files: what their images show. 1: residuals without a sign; 2: x, y and intensity beside."""
BASE_CHANNELS = ("range", "z")
"""Neither changes when the sensor turns. No intensity: every kind of sensor measures it on a scale of its own."""


@dataclass(frozen=True, eq=False)
class Window:
    """A scan and earlier ones, each compensated and in its own sensor frame.

    Attributes
    ----------
    points : (N, 3) float32, metres.
    past : K earlier clouds (M, 3) float32, None if there is none.
    T_now_past : (K, 4, 4) float64, from each of them to the present one.
    """

    points: Points
    past: tuple[Points | None, ...]
    T_now_past: Pose


@dataclass(frozen=True, eq=False)
class RangeImage:
    """A window as the network sees it, and the way back to points.

    Attributes
    ----------
    channels : (2 + K, H, W) float32
        Range, z, residuals; 0 if a pixel is empty.
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


def make_image(window: Window, grid: ImageGrid) -> RangeImage:
    """Return the image of `window`."""
    pixels, ranges = project(window.points, grid)
    index = nearest_points(pixels, ranges, grid.size)
    shown = np.flatnonzero(index >= 0)
    rows = index[shown]
    base = np.zeros((len(BASE_CHANNELS), grid.size), np.float32)
    base[0, shown] = ranges[rows]
    base[1, shown] = window.points[rows, 2]
    images = base.reshape(-1, grid.height, grid.width)
    residuals = residual_images(images[0], window.past, window.T_now_past, grid)
    return RangeImage(np.concatenate([images, residuals]), index.reshape(grid.height, grid.width), pixels, ranges)


def thin(points: Points, grid: ImageGrid) -> npt.NDArray[np.int64]:
    """Return the rows of the points that are seen in the image, in order: all that earlier scans are needed for."""
    pixels, ranges = project(points, grid)
    index = nearest_points(pixels, ranges, grid.size)
    return np.sort(index[index >= 0]).astype(np.int64)
