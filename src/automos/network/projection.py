"""Scans as range images: which pixel each point falls into, and which point each pixel shows.

Rows follow the sensor's own beams, given as a table from the sine of elevation to the row, so that even, blocked and
sparse beams all fill their rows; columns are even in azimuth. A point outside the beams' range goes to the nearest row.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.scan import MIN_RANGE, Points

SINE_BINS = 4096

Image = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ImageGrid:
    """Where directions fall on an image.

    Attributes
    ----------
    height, width : int
        Pixels; row 0 looks up most, column 0 backwards, columns go clockwise.
    row_of_sine : (SINE_BINS + 1,) float32
        Row (a pixel's centre is at + 0.5) at sines of elevation evenly spaced in [-1, 1].
    """

    height: int
    width: int
    row_of_sine: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        if self.row_of_sine.shape != (SINE_BINS + 1,):
            raise ValueError(f"row_of_sine must be ({SINE_BINS + 1},), got shape {self.row_of_sine.shape}")

    @property
    def size(self) -> int:
        """Number of pixels."""
        return self.height * self.width


def beam_grid(height: int, width: int, beam_of_sine: npt.NDArray, n_beams: int) -> ImageGrid:
    """Return a grid whose rows are a sensor's beams, evenly shared out where there are more or fewer of them.

    Parameters
    ----------
    beam_of_sine : (SINE_BINS + 1,) array
        Number of the beam, counted from below, its centre at + 0.5, at each sine.
    n_beams : int
        How many there are.
    """
    row = height * (1.0 - np.asarray(beam_of_sine, np.float64) / n_beams)
    return ImageGrid(height, width, row.astype(np.float32))


def project(points: Points, grid: ImageGrid) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Return the pixel (N,) int32 each point falls into, row * width + column, and its range (N,) float32 in metres.

    Points that are not finite or nearer than MIN_RANGE have pixel -1 and range 0.
    """
    return _project(np.ascontiguousarray(points), grid.row_of_sine, grid.height, grid.width)


@kernel
def nearest_points(pixels, ranges, n_pixels):  # type: ignore[no-untyped-def]
    """Return (n_pixels,) int32: the nearest point of each pixel (the first of equals), -1 if there is none.

    pixels, ranges : (N,) int32 and float32, of the points.
    """
    index = np.full(n_pixels, -1, np.int32)
    for i in range(len(pixels)):
        p = pixels[i]
        if p >= 0 and (index[p] < 0 or ranges[i] < ranges[index[p]]):
            index[p] = i
    return index


@kernel
def row_of(sine, row_of_sine):  # type: ignore[no-untyped-def]
    """Return the row of a direction, below 0 or beyond the image where no beam looks."""
    row = row_of_sine[int((sine + 1.0) * (0.5 * SINE_BINS) + 0.5)]
    return int(np.floor(row)) if abs(row) < 1e9 else -1


@kernel
def column_of(x, y, width):  # type: ignore[no-untyped-def]
    """Return the column of a direction."""
    return min(int(0.5 * (1.0 - np.arctan2(y, x) / np.pi) * width), width - 1)


@kernel
def _project(points, row_of_sine, height, width):  # type: ignore[no-untyped-def]
    pixels, ranges = np.empty(len(points), np.int32), np.empty(len(points), np.float32)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r = np.sqrt(x * x + y * y + z * z)
        if np.isfinite(r) and r > MIN_RANGE:
            row = min(max(row_of(z / r, row_of_sine), 0), height - 1)
            pixels[i] = row * width + column_of(x, y, width)
            ranges[i] = r
        else:
            pixels[i], ranges[i] = -1, 0.0
    return pixels, ranges
