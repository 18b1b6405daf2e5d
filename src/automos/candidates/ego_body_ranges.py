"""Ranges near the sensor over many scans: constant, or repeatedly within arm's reach."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_grid import BeamPattern
from automos.candidates.free_space_image import NO_RAY, UNIT, locate, project
from automos.candidates.free_space_sweep import raw_points
from automos.scan import Frame, Points
from automos.settings import EgoBodySettings

Ranges = npt.NDArray[np.float32]
GRAZING = 0.15
"""Share of a range by which that of the next ray may differ on a face met at a grazing angle; more is an edge."""
NEAR_SHARE = 0.15
"""Least share of scans that return from within arm's reach where an arm swings; other objects pass there once."""
NEAR_MARGIN = np.float32(0.1)
"""Metres by which the body may reach beyond the farthest return from within arm's reach."""


def nearest_ranges(frame: Frame, pattern: BeamPattern, max_range: float) -> Ranges:
    """Return (H, W) the nearest range in each cell, metres; infinite beyond `max_range`, NaN without return."""
    nearest = project(raw_points(frame), pattern).rays[..., 0]
    ranges = np.where(nearest < max_range / UNIT, np.float32(UNIT) * nearest, np.float32(np.inf))
    return np.where(nearest == NO_RAY, np.float32(np.nan), ranges)


def find_constant(ranges: Ranges, settings: EgoBodySettings) -> Ranges:
    """Return (2, H, W): the range up to which a body reaches where most of `ranges` (K, H, W) agree, and its tolerance.

    A face met at a grazing angle (a trailer's long side) changes its range by much when it swings by little, so
    ranges also agree if they differ by less than half the difference between neighbouring rays.
    """
    n = (~np.isnan(ranges)).sum(axis=0)
    ordered = np.sort(ranges, axis=0)  # NaN last
    middle = np.take_along_axis(ordered, np.stack([np.maximum(n - 1, 0) // 2, np.minimum(n // 2, len(ranges) - 1)]), 0)
    with np.errstate(invalid="ignore"):  # of infinities
        median = np.where(n >= settings.min_share * len(ranges), 0.5 * middle.sum(axis=0), np.float32(np.inf))
        steps = np.abs(np.stack([np.roll(median, shift, axis=1) for shift in (-1, 1)]) - median)
        tolerance = settings.tolerance + 0.5 * np.where(steps < GRAZING * median, steps, np.float32(0.0)).max(axis=0)
        n_same = (np.abs(ranges - median) < tolerance).sum(axis=0)
    is_same = np.isfinite(median) & (n_same >= settings.min_share * n)
    return np.where(is_same, np.stack([median + tolerance, tolerance]), np.float32(0.0))


def find_near(ranges: Ranges, near_reach: float) -> Ranges:
    """Return (H, W) the range up to which a body reaches where scans repeatedly return from within `near_reach`."""
    is_near = ranges < near_reach
    farthest = np.where(is_near, ranges, np.float32(0.0)).max(axis=0)
    return np.where(is_near.mean(axis=0) >= NEAR_SHARE, farthest + NEAR_MARGIN, np.float32(0.0))


def cells_within(points: Points, reach: Ranges, pattern: BeamPattern) -> npt.NDArray[np.int32]:
    """Return (M,) the cell, row * columns + column, of each of `points` (M, 3) nearer than its cell's `reach`.

    The points are those of a raw sweep; those that are not nearer have -1.
    """
    cell, ranges = locate(points, pattern)
    return np.where(ranges < np.append(reach, np.float32(0.0))[cell], cell, np.int32(-1))
