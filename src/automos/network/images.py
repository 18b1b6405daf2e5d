"""What the network is given: one scan as a range image with its residuals, made from points and poses.

A residual image shows what earlier scans found at the place that a pixel shows now. LMNet's residual (III-A) is
|range now - range before| / range now along one pixel. It says the same of a place that was free before (something came
here) and of one that was hidden before (something went away), and in foliage and at edges, where a neighbouring ray hit
something else, it is as large as for what moves. So the sign is kept, and the rays around the pixel are asked as well:
seen as free is only what all of them passed. The pictures are made when they are needed, never stored.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.cells import moved
from automos.core.kernels import kernel
from automos.core.scan import Points, Pose
from automos.network.projection import Image, ImageGrid, column_of, nearest_points, project, row_of

SPACING = 0.2
"""Seconds between the scans of successive residual images: eight of them see a walker's place before he came."""

MIN_RANGE, MAX_RANGE = 2.0, 80.0
"""Metres between which ranges have residuals: the vehicle itself, and what is too sparse."""

TOLERANCE = (0.3, 0.02)
"""Metres, and metres more for each metre of range, within which two ranges are of the same thing."""


def residual_images(
    range_now: Image,
    past: Sequence[Points | None],
    T_now_past: Pose,
    grid: ImageGrid,
) -> Image:
    """Return (K, H, W) float32 in [-1, 1]: -1 something was here, 1 the place was free, 0 it is unknown.

    Of the rays that went past a pixel before, in a window of 3 x 3 pixels, that one counts whose range comes nearest
    to the range of now. With g, by how many times the tolerance it went further, the value is (g - 1) / (g + 1); where
    it ended before the place, which was hidden, -max(0, 1 + g).

    Parameters
    ----------
    range_now : (H, W) float32
        Metres, 0 if a pixel is empty.
    past : sequence of Points, optional
        K earlier clouds (M, 3) float32 in their own sensor frames; None if there is none, which gives zeros.
    T_now_past : (K, 4, 4) float64
        From each cloud's frame to the present one.
    """
    out = np.zeros((len(past), grid.height, grid.width), np.float32)
    for k, points in enumerate(past):
        if points is not None:
            T, rows = np.asarray(T_now_past[k], np.float32), grid.row_of_sine
            before = _reproject(np.ascontiguousarray(points), T, rows, grid.height, grid.width, MAX_RANGE)
            _residual(range_now, before, np.float32(MIN_RANGE), np.float32(MAX_RANGE), out[k])
    return out


def pick_past(ages: npt.NDArray[np.float64], n: int, spacing: float = SPACING) -> npt.NDArray[np.int64]:
    """Return for residual images 1..n which earlier scan to take, -1 for none.

    Parameters
    ----------
    ages : (M,) float64
        Seconds > 0 since each of the earlier scans.
    n : int
        Residual images; image k looks back k * spacing seconds.
    spacing : float
        Seconds. Scans that are further than this from the wanted moment are not taken, so sensors of any rate see the
        same spans of time.
    """
    wanted = spacing * np.arange(1, n + 1)
    if len(ages) == 0:
        return np.full(n, -1)
    off = np.abs(ages[None, :] - wanted[:, None])  # (n, M)
    best = off.argmin(axis=1)
    return np.where(off[np.arange(n), best] <= 1.001 * spacing, best, -1)


@kernel
def _reproject(points, T, row_of_sine, height, width, farthest):  # type: ignore[no-untyped-def]
    before = np.full((height, width), np.float32(np.inf))
    for i in range(len(points)):
        x, y, z = moved(T, points[i, 0], points[i, 1], points[i, 2])
        r = np.sqrt(x * x + y * y + z * z)
        if np.float32(1e-3) < r < farthest:  # never true of NaN
            row = row_of(z / r, row_of_sine)
            if 0 <= row < height:  # what lies beyond the beams of now was not measured now
                column = column_of(x, y, width)
                before[row, column] = min(before[row, column], r)
    return before


@kernel
def _residual(now, before, nearest, farthest, out):  # type: ignore[no-untyped-def]
    height, width = now.shape
    for row in range(height):
        for column in range(width):
            r = now[row, column]
            if not (nearest < r < farthest):
                continue
            gap = np.float32(np.inf)
            for i in range(max(row - 1, 0), min(row + 2, height)):
                for j in range(column - 1, column + 2):
                    there = before[i, (j + width) % width]
                    if nearest < there < farthest and abs(there - r) < abs(gap):
                        gap = there - r
            if np.isfinite(gap):
                g = gap / (np.float32(TOLERANCE[0]) + np.float32(TOLERANCE[1]) * r)
                out[row, column] = (g - 1) / (g + 1) if g >= 0 else -max(np.float32(0.0), 1 + g)


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
        return _rows_shown(self.index)


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
    return _rows_shown(nearest_points(*project(points, grid), grid.size))


def _rows_shown(index: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    return np.sort(index[index >= 0]).astype(np.int64)
