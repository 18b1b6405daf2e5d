"""Where a sensor's rays end near it, scan after scan: at the same range, or always from within arm's reach."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_pattern import BeamPattern, raw_points
from automos.cells import sine_bin, turn_of
from automos.kernels import kernel
from automos.scan import Frame
from automos.settings import EgoBodySettings

GRAZING = 0.15
"""Of a range, by which the next ray's may differ on the same face, met at a grazing angle; more is an edge."""


def nearest_ranges(frame: Frame, pattern: BeamPattern, max_range: float) -> npt.NDArray[np.float32]:
    """Return (H, W) the nearest range of each cell, infinite beyond `max_range`, 0 without return."""
    image = np.zeros((pattern.n_rows, pattern.n_columns), np.float32)
    _keep_nearest(raw_points(frame), np.float32(max_range), pattern.row_of_sine, image)
    return image


def find_constant(ranges: npt.NDArray[np.float32], settings: EgoBodySettings) -> npt.NDArray[np.float32]:
    """Return (2, H, W): how far a body reaches where most of `ranges` (K, H, W) are the same, and how exactly.

    A face that is met at a grazing angle (a trailer's long side) changes its range by much when it swings by little:
    ranges are the same where they differ by less than half of what lies between neighbouring rays, too.
    """
    median = np.empty(ranges.shape[1:], np.float32)
    _median_range(ranges, settings.min_share, median)
    slope = np.zeros_like(median)
    with np.errstate(invalid="ignore"):
        for shift in (-1, 1):
            step = np.abs(np.roll(median, shift, axis=1) - median)
            slope = np.maximum(slope, np.where(step < GRAZING * median, step, 0.0))
    tolerance = np.float32(settings.tolerance) + 0.5 * slope
    is_same = np.zeros(median.shape, np.bool_)
    _is_constant(ranges, median, tolerance, settings.min_share, is_same)
    return np.where(is_same, np.stack([median + tolerance, tolerance]), np.float32(0.0))


@kernel
def _median_range(ranges, min_share, median):  # type: ignore[no-untyped-def]
    """Write each cell's median range, infinite where less than `min_share` of the scans returned."""
    n, h, w = ranges.shape
    values = np.empty(n, np.float32)
    for v in range(h):
        for u in range(w):
            m = 0
            for k in range(n):
                if ranges[k, v, u] > 0.0:
                    at = m  # kept in order: sorting costs seconds to compile
                    while at > 0 and values[at - 1] > ranges[k, v, u]:
                        values[at] = values[at - 1]
                        at -= 1
                    values[at] = ranges[k, v, u]
                    m += 1
            is_there = m > 0 and m >= min_share * n
            median[v, u] = 0.5 * (values[(m - 1) // 2] + values[m // 2]) if is_there else np.inf


@kernel
def _is_constant(ranges, median, tolerance, min_share, is_same):  # type: ignore[no-untyped-def]
    """Mark the cells where at least `min_share` of the returns are within `tolerance` of the median."""
    n, h, w = ranges.shape
    for v in range(h):
        for u in range(w):
            if not np.isfinite(median[v, u]):
                continue
            m, same = 0, 0
            for k in range(n):
                m += ranges[k, v, u] > 0.0
                same += ranges[k, v, u] > 0.0 and abs(ranges[k, v, u] - median[v, u]) < tolerance[v, u]
            is_same[v, u] = same >= min_share * m


def find_near(
    ranges: npt.NDArray[np.float32], near_reach: float, min_share: float, reach: npt.NDArray[np.float32]
) -> None:
    """Set `reach` where most scans return from within `near_reach`, whatever the range."""
    is_near = (ranges > 0.0) & (ranges < near_reach)
    farthest = np.where(is_near, ranges, np.float32(0.0)).max(axis=0)
    reach[:] = np.where(is_near.mean(axis=0) >= min_share, farthest + np.float32(0.1), np.float32(0.0))


@kernel
def _keep_nearest(points, max_range, row_of_sine, image):  # type: ignore[no-untyped-def]
    h, w = image.shape
    for i in range(len(points)):
        r, v, u = cell_of(points[i, 0], points[i, 1], points[i, 2], row_of_sine, h, w)
        if v >= 0:
            r = r if r < max_range else np.float32(np.inf)
            if image[v, u] == 0.0 or r < image[v, u]:
                image[v, u] = r


@kernel
def cell_of(x, y, z, row_of_sine, h, w):  # type: ignore[no-untyped-def]
    """Range, row (-1 outside the pattern) and column of a point."""
    r = np.sqrt(x * x + y * y + z * z)
    row = row_of_sine[sine_bin(z, r, len(row_of_sine))]
    v = int(row) if 0.0 <= row < h else -1
    return r, v, int(turn_of(x, y) * np.float32(w))
