"""Range images: the nearest (or farthest) point per pixel of evenly spaced elevations and azimuths."""

from typing import NamedTuple

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.beam_pattern import BeamPattern, learn_pattern
from automos.core.cells import turn_of
from automos.core.kernels import kernel
from automos.core.scan import Frames

NOTHING = np.float32(np.inf)

_EDGE_DEG = 60.0  # no ray of a spinning sensor rises or falls more steeply


class ImageShape(NamedTuple):
    """Pixels of a range image that goes all the way round.

    Attributes
    ----------
    rows, columns : int
        Pixels; row 0 is the lowest, column 0 begins behind the sensor.
    lowest : float
        Radians, elevation at which row 0 begins.
    row_height : float
        Radians.
    """

    rows: int
    columns: int
    lowest: float
    row_height: float


def image_shape(row_deg: float, column_deg: float, lowest_deg: float, highest_deg: float) -> ImageShape:
    """Return the shape of an image with pixels of about `row_deg` x `column_deg` between two elevations, degrees."""
    rows = max(round((highest_deg - lowest_deg) / row_deg), 1)
    columns = max(round(360.0 / column_deg), 1)
    return ImageShape(rows, columns, float(np.radians(lowest_deg)), float(np.radians(highest_deg - lowest_deg)) / rows)


def shape_for(frames: Frames, row_deg: float, column_deg: float) -> ImageShape:
    """Return the shape of images of what `frames` saw: pixels of that size, or as wide apart as the sensor's rays lie.

    A sensor of few beams leaves whole rows of finer pixels empty, and nothing could be compared there.
    """
    return shape_of(pattern_of(frames), row_deg, column_deg)


def pattern_of(frames: Frames) -> BeamPattern:
    """Return how the sensor's rays lie."""
    return learn_pattern(evenly_spread(frames, 5))


def shape_of(pattern: BeamPattern, row_deg: float, column_deg: float) -> ImageShape:
    """Return the shape of images with pixels of that size, or as wide apart as the rays of `pattern` lie."""
    row_deg = max(row_deg, float(np.degrees(pattern.row_height)))
    return image_shape(row_deg, max(column_deg, float(np.degrees(pattern.column_width))), -_EDGE_DEG, _EDGE_DEG)


@kernel
def pixel_of(x, y, z, shape):  # type: ignore[no-untyped-def]
    """Return row, column and range of a point (float32) in the sensor frame; row -1 if it is out of the image."""
    level = np.sqrt(x * x + y * y)
    r = np.sqrt(x * x + y * y + z * z)
    # `turn_of` is half a turn ahead and grows with the angle: of (level, z) it is the elevation.
    elevation = (turn_of(level, z) - np.float32(0.5)) * np.float32(6.2831853)
    row = (elevation - np.float32(shape.lowest)) / np.float32(shape.row_height)
    if not np.float32(0.0) <= row < shape.rows:
        return -1, 0, r
    return int(row), int(turn_of(x, y) * shape.columns), r


@kernel
def nearest_ranges(points, shape):  # type: ignore[no-untyped-def]
    """Return (rows, columns) float32: the shortest range of `points` (M, 3), sensor frame, in each pixel, else inf."""
    image = np.full((shape.rows, shape.columns), NOTHING)
    for i in range(len(points)):
        v, u, r = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
        if v >= 0:
            image[v, u] = min(image[v, u], r)
    return image
