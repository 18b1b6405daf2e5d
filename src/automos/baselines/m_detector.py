"""M-detector: a point that hides what was seen a moment ago has moved, and so has what goes behind or before itself.

Our reading of Wu, Li, Xu, Kong, Zhang, "Moving event detection from LiDAR point streams" (Nature Communications 2024),
scan by scan. Past scans are depth images. Test 1: the point lies before the static points of several images, and on
those of none. Tests 2 and 3: along its ray, what was seen before went away, or came nearer, step by step. The points
that pass are clustered, small clusters dropped, the others completed ("frame-out"). Only the past is used.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from automos.baselines.batches import is_within
from automos.baselines.neighbours_in_time import scans_at
from automos.baselines.range_image import ImageShape, pixel_of, shape_for
from automos.baselines.regions import drop_small_regions, grow_regions
from automos.candidates.ground import segment_ground
from automos.geometry import inverse, transform
from automos.scan import Frame, Frames, Mask
from automos.settings import GroundSettings, MDetectorSettings


@dataclass(frozen=True, eq=False)
class _DepthImage:
    """A past scan. `static` and `all` are (rows, columns, 2) float32: shortest and longest range around each pixel."""

    frame: Frame
    stamp: float
    static: npt.NDArray[np.float32]
    all: npt.NDArray[np.float32]


def find_moving(
    frames: Frames, stamps: npt.NDArray, settings: MDetectorSettings, ground: GroundSettings, start: int = 0
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order. `stamps` (N,) are their times, s."""
    shape = shape_for(frames, settings.row_deg, settings.column_deg)
    lags = settings.gap * np.arange(1, settings.images + 1)
    warm_up = min([*scans_at(stamps, start, -2.0 * lags), start])
    past: deque[tuple[int, _DepthImage]] = deque()
    for k in range(warm_up, len(frames)):
        frame = frames[k]
        asked = scans_at(stamps, k, -lags)
        while past and past[0][0] < min([*asked, k]):
            past.popleft()
        images = [image for j in asked for i, image in past if i == j]
        is_object = ~segment_ground(frame.points_level, frame.origin_level, ground)
        is_object &= is_within(frame, settings.max_range)
        is_moving = _find_events(frame, is_object, float(stamps[k]), images, shape, settings)
        is_moving = drop_small_regions(frame.points_level, is_moving, settings.cluster_voxel, settings.cluster_points)
        is_moving = grow_regions(
            frame.points_level, is_moving, is_object, settings.cluster_voxel, settings.cluster_steps
        )
        past.append((k, _draw(frame, float(stamps[k]), is_moving, shape)))
        if k >= start:
            yield k, is_moving


def _draw(frame: Frame, stamp: float, is_moving: Mask, shape: ImageShape) -> _DepthImage:
    return _DepthImage(frame, stamp, _span_around(frame.points[~is_moving], shape), _span_around(frame.points, shape))


@numba.njit(cache=True, nogil=True)
def _span_around(points, shape):  # type: ignore[no-untyped-def]
    """Return (rows, columns, 2) float32: shortest and longest range of 3 x 3 pixels; inf, -inf: none."""
    h, w = shape.rows, shape.columns
    span = np.empty((h, w, 2), np.float32)
    span[:, :, 0], span[:, :, 1] = np.inf, -np.inf
    for i in range(len(points)):
        v, u, r = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
        if v >= 0:
            for b in range(max(v - 1, 0), min(v + 2, h)):
                for a in range(u - 1, u + 2):
                    a = a - w if a >= w else a  # negative columns count from the end by themselves
                    span[b, a, 0] = min(span[b, a, 0], r)
                    span[b, a, 1] = max(span[b, a, 1], r)
    return span


def _find_events(
    frame: Frame,
    is_object: Mask,
    stamp: float,
    images: list[_DepthImage],
    shape: ImageShape,
    settings: MDetectorSettings,
) -> Mask:
    """Return (M,) bool: the frame's points that pass any of the three tests; `images` are from near to far in time."""
    n = int(is_object.sum())
    hides, agrees = np.zeros((2, n), np.int32)
    ranges, times = np.full((n, len(images) + 1), np.nan, np.float32), np.zeros(len(images) + 1)
    ranges[:, 0] = np.linalg.norm(frame.points[is_object], axis=1)
    for column, image in enumerate(images, start=1):
        there = transform(inverse(image.frame.T_level_sensor) @ frame.T_level_sensor, frame.points[is_object])
        times[column] = stamp - image.stamp
        _compare(
            there, image.static, image.all, shape, settings.depth, settings.depth_share, hides, agrees, ranges, column
        )
    out = np.zeros_like(is_object)
    out[is_object] = (hides >= settings.min_occluded) & (agrees <= settings.max_agreeing)
    out[is_object] |= _goes_along_ray(
        ranges, times, settings.depth, settings.depth_share, settings.max_speed, settings.chain
    )
    return out


@numba.njit(cache=True, nogil=True)
def _compare(points, static, everything, shape, depth, share, hides, agrees, ranges, column):  # type: ignore[no-untyped-def]
    """Add to `hides` and `agrees` (M,) what one image says; write into `ranges` how far it saw, as if from here."""
    for i in range(len(points)):
        v, u, r = pixel_of(points[i, 0], points[i, 1], points[i, 2], shape)
        if v < 0:
            continue
        tolerance = depth + share * r
        if static[v, u, 0] < np.inf:
            if static[v, u, 0] > r + tolerance:
                hides[i] += 1
            elif static[v, u, 1] >= r - tolerance:
                agrees[i] += 1
        if everything[v, u, 0] < np.inf and everything[v, u, 1] - everything[v, u, 0] < tolerance:
            ranges[i, column] = ranges[i, 0] + 0.5 * (everything[v, u, 0] + everything[v, u, 1]) - r


@numba.njit(cache=True, nogil=True)
def _goes_along_ray(ranges, times, depth, share, max_speed, chain):  # type: ignore[no-untyped-def]
    """Return (M,) bool: the points whose direction held something ever nearer, or ever farther, back in time.

    ranges : (M, I + 1) metres from now back, nan where there was none.   times : (I + 1,) seconds ago.
    """
    out = np.zeros(len(ranges), np.bool_)
    for i in range(len(ranges)):
        for sign in (-1.0, 1.0):
            steps, last, speed = 0, 0, 0.0
            for j in range(1, len(times)):
                way = sign * (ranges[i, j] - ranges[i, last])
                gap = times[j] - times[last]
                if np.isnan(way) or way < depth + share * ranges[i, 0]:
                    continue
                if way > max_speed * gap or (steps > 0 and not 0.67 * speed < way / gap < 1.5 * speed):
                    break
                steps, last, speed = steps + 1, j, way / gap
            out[i] |= steps >= chain
    return out
