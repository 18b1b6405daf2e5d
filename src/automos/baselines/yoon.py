"""Yoon's method: what is far from everything another scan saw, where that scan saw free space, has moved.

Our reading of Yoon, Tang and Barfoot, "Mapless Online Detection of Dynamic Objects in 3D Lidar" (CRV 2019): every scan
is compared with one before and one after it, motion compensated and aligned. Points without a neighbour there are
candidates; those on rays of the other scan that went on are kept, those that were hidden or out of its sight are not; a
box filter takes lone ones away; regions grow from what is left over near points that are not ground.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from automos.baselines.batches import is_within, scans_at
from automos.baselines.range_image import NOTHING, ImageShape, nearest_ranges, pixel_of, shape_for
from automos.baselines.regions import grow_regions
from automos.core.geometry import inverse, transform
from automos.core.kernels import kernel
from automos.core.range_image import over_neighbours
from automos.core.scan import Frame, Frames, Mask
from automos.evidence.ground import find_ground
from automos.settings import GroundSettings


@dataclass(frozen=True)
class Parameters:
    """The paper gives no numbers for 64 beams; these are ours, from the sensor's rays (docs/baselines.md).

    Attributes
    ----------
    gap : float
        Seconds between a scan and those before and after that it is compared with.
    residual : float
        Metres to the nearest point of the other scan, from which on a point is a candidate.
    window_deg : float
        Degrees, rays of the other scan that speak of a candidate.
    margin : float
        Metres, how far behind a candidate these rays must all end.
    box_deg, box_points : float and int
        Half the side of the box filter in the range image, degrees; candidates in it that keep one.
    grow_gap, grow_steps : float and int
        Metres that regions do not cross; such steps, at most, from a seed.
    max_range : float
        Metres, points used.
    """

    gap: float = 0.5
    residual: float = 0.3
    window_deg: float = 0.5
    margin: float = 0.5
    box_deg: float = 1.0
    box_points: int = 4
    grow_gap: float = 0.4
    grow_steps: int = 5
    max_range: float = 80.0


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is kept of a scan while others are compared with it."""

    frame: Frame
    tree: cKDTree
    shortest: npt.NDArray[np.float32]  # of the rays around each pixel


def find_moving(
    frames: Frames, parameters: Parameters, stamps: npt.NDArray, ground: GroundSettings, start: int = 0
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order. `stamps` (N,) are their times, s."""
    shape = shape_for(frames, parameters.window_deg, parameters.window_deg)
    seen: dict[int, _Seen] = {}
    for k in range(start, len(frames)):
        others = scans_at(stamps, k, (-parameters.gap, parameters.gap))
        for j in sorted({k, *others} - set(seen)):
            seen[j] = _look(frames[j], shape)
        seen = {j: scan for j, scan in seen.items() if j >= min([k, *others])}
        frame = seen[k].frame
        is_seed = np.zeros(len(frame.points), bool)
        for j in others:
            is_seed |= _find_changed(frame, seen[j], shape, parameters)
        is_object = ~find_ground(frame.points_level, frame.origin_level, ground)[0]
        is_object &= is_within(frame, parameters.max_range)
        is_seed &= is_object
        is_seed &= _has_company(
            frame.points, is_seed, shape, round(parameters.box_deg / parameters.window_deg), parameters.box_points
        )
        yield k, grow_regions(frame.points_level, is_seed, is_object, parameters.grow_gap, parameters.grow_steps)


def _look(frame: Frame, shape: ImageShape) -> _Seen:
    return _Seen(frame, cKDTree(frame.points_level), over_neighbours(nearest_ranges(frame.points, shape), np.minimum))


def _find_changed(frame: Frame, other: _Seen, shape: ImageShape, parameters: Parameters) -> Mask:
    """Return (M,) bool: the frame's points where the other scan saw nothing near, but rays that went on behind."""
    there = transform(inverse(other.frame.T_level_sensor) @ frame.T_level_sensor, frame.points)
    is_changed = np.zeros(len(there), bool)
    _find_free(there, other.shortest, shape, parameters.margin, parameters.max_range, is_changed)
    rows = np.flatnonzero(is_changed)  # free space first: it is quicker to test
    residual, _ = other.tree.query(frame.points_level[rows], distance_upper_bound=parameters.residual)
    is_changed[rows] = np.isinf(residual)
    return is_changed


@kernel
def _find_free(points, shortest, shape, margin, max_range, is_free):  # type: ignore[no-untyped-def]
    for i in range(len(points)):
        v, u, r = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
        if v >= 0 and r < max_range and shortest[v, u] != NOTHING:
            is_free[i] = shortest[v, u] - r > margin


@kernel
def _has_company(points, is_seed, shape, reach, min_points):  # type: ignore[no-untyped-def]
    """Return (M,) bool: the seeds with at least `min_points` seeds within `reach` pixels, themselves counted."""
    counts = np.zeros((shape.rows, shape.columns), np.int32)
    for i in range(len(points)):
        if is_seed[i]:
            v, u, _ = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
            if v >= 0:
                counts[v, u] += 1
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if is_seed[i]:
            v, u, _ = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
            n = 0
            for b in range(max(v - reach, 0), min(v + reach + 1, shape.rows)):
                for a in range(u - reach, u + reach + 1):
                    n += counts[b, a % shape.columns]
            out[i] = v >= 0 and n >= min_points
    return out
