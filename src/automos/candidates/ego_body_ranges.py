"""Where a sensor's rays end near it, scan after scan: at the same range, or always from within arm's reach."""

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
"""Of a range, by which the next ray's may differ on the same face, met at a grazing angle; more is an edge."""
NEAR_SHARE = 0.15
"""Of the scans, that return from within arm's reach where an arm swings; the world, and others, pass there once."""
NEAR_MARGIN = np.float32(0.1)
"""Metres beyond what returned from within arm's reach, as far as the body may reach there."""


def nearest_ranges(frame: Frame, pattern: BeamPattern, max_range: float) -> Ranges:
    """Return (H, W) the nearest range in each cell, metres; infinite beyond `max_range`, NaN without return."""
    nearest = project(raw_points(frame), pattern).rays[..., 0]
    ranges = np.where(nearest < max_range / UNIT, np.float32(UNIT) * nearest, np.float32(np.inf))
    return np.where(nearest == NO_RAY, np.float32(np.nan), ranges)


def find_constant(ranges: Ranges, settings: EgoBodySettings) -> Ranges:
    """Return (2, H, W): how far a body reaches where most of `ranges` (K, H, W) are the same, and how exactly.

    A face that is met at a grazing angle (a trailer's long side) changes its range by much when it swings by little:
    ranges are the same where they differ by less than half of what lies between neighbouring rays, too.
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
    """Return (H, W) how far a body reaches where scans return from within `near_reach`, whatever the range."""
    is_near = ranges < near_reach
    farthest = np.where(is_near, ranges, np.float32(0.0)).max(axis=0)
    return np.where(is_near.mean(axis=0) >= NEAR_SHARE, farthest + NEAR_MARGIN, np.float32(0.0))


def cells_within(points: Points, reach: Ranges, pattern: BeamPattern) -> npt.NDArray[np.int32]:
    """Return (M,) the cell, row times columns plus column, of each of `points` (M, 3) nearer than its cell's `reach`.

    Points are those of a raw sweep; -1 for those that are not.
    """
    cell, ranges = locate(points, pattern)
    return np.where(ranges < np.append(reach, np.float32(0.0))[cell], cell, np.int32(-1))
