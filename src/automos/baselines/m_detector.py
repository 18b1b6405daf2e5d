"""M-detector: a point that hides what was seen a moment ago has moved, and so has what goes behind or before itself.

Our reading of Wu, Li, Xu, Kong, Zhang, "Moving event detection from LiDAR point streams" (Nature Communications 2024)
with the authors' parameters for the sensor whose rays lie apart most like those of the one at hand, scan by scan;
pixels are no finer than rays and depth images no closer in time than scans, as the authors ask. Past scans are depth
images that keep their points. Points that pass one of three tests are events; clusters of them are completed to
objects, and what was found is no longer taken for something that stood ("frame-out", "cluster future"). Only the past
is used.
"""

from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from automos.baselines.depth_images import DepthImage, Stack, Window, draw, stack
from automos.baselines.m_detector_parameters import Parameters
from automos.baselines.neighbours_in_time import scans_at
from automos.baselines.occlusion_tests import find_along_ray, find_crossing, leave_out_standing
from automos.baselines.range_image import ImageShape, pattern_of, shape_of
from automos.baselines.regions import label_regions
from automos.core.geometry import inverse
from automos.core.scan import Frame, Frames, Mask
from automos.evidence.ground import find_ground
from automos.settings import GroundSettings

_PREFILTER = 2
"""Images in which most of what stands is found, before the tests are asked."""


def find_moving(
    frames: Frames, published: Sequence[Parameters], stamps: npt.NDArray, ground: GroundSettings, start: int = 0
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order. `stamps` (N,) are their times, s."""
    pattern = pattern_of(frames)
    apart = shape_of(pattern, 0.0, 0.0).row_height
    parameters = min(published, key=lambda one: abs(np.log(one.row / apart)))
    shape = shape_of(pattern, float(np.degrees(parameters.row)), float(np.degrees(parameters.column)))
    tests = _Tests(parameters, shape)
    gap = max(parameters.gap, float(np.median(np.diff(stamps)))) if len(stamps) > 1 else parameters.gap
    lags = gap * np.arange(1, parameters.images + 1)
    warm_up = min([*scans_at(stamps, start, -2.0 * lags), start])
    past: deque[tuple[int, DepthImage]] = deque()
    for k in range(warm_up, len(frames)):
        frame, asked = frames[k], scans_at(stamps, k, -lags)
        while past and past[0][0] < min([*asked, k]):
            past.popleft()
        images = [image for j in asked for i, image in past if i == j]
        is_event = tests.find_events(frame, float(stamps[k]), images)
        is_object = ~find_ground(frame.points_level, frame.origin_level, ground)[0]
        is_moving = complete_clusters(frame.points_level, is_event, is_object, parameters)
        past.append((k, draw(frame.points, is_moving, frame.T_level_sensor, float(stamps[k]), shape)))
        if k >= start:
            yield k, is_moving


class _Tests:
    """The three tests."""

    def __init__(self, parameters: Parameters, shape: ImageShape):
        """Take what is published and the images' shape."""
        self._shape, self._blind, self._crossing = shape, parameters.blind, parameters.crossing
        self._along = (parameters.away, parameters.nearer)
        # what agrees within the smaller of their windows stands for cases 2 and 3
        width, height = (min(case.stands[i] for case in self._along) for i in (0, 1))
        self._prefilter = Window(width, height)
        self._plainly = min(case.tolerance for case in self._along)

    def find_events(self, frame: Frame, stamp: float, images: list[DepthImage]) -> Mask:
        """Return (M,) bool: the frame's points that pass any of the tests; `images` are from new to old."""
        points, shape = frame.points, self._shape
        ranges = np.sqrt(np.einsum("ij,ij->i", points, points))
        is_asked = ranges > self._blind
        if not images:
            return np.zeros_like(is_asked)
        past = stack(images)
        T = np.stack([_between(image.T_level_sensor, frame.T_level_sensor) for image in images])
        is_event = find_crossing(points, is_asked, T, past, self._crossing, shape)
        leave_out_standing(points, is_asked, T, past, self._prefilter, self._plainly, _PREFILTER, shape)
        if len(images) > 1:
            now: Stack = stack([draw(points, np.zeros_like(is_asked), frame.T_level_sensor, stamp, shape)])
            T_between = _between(images[1].T_level_sensor, images[0].T_level_sensor)
            gaps = -np.diff([stamp, images[0].stamp, images[1].stamp])
            for case in self._along:
                is_event |= find_along_ray(points, is_asked & ~is_event, T, T_between, gaps, now, past, case, shape)
        return is_event


def _between(T_level_there: npt.NDArray, T_level_here: npt.NDArray) -> npt.NDArray[np.float32]:
    """Return (3, 4) float32, the transform from one sensor frame to another."""
    return (inverse(T_level_there) @ T_level_here)[:3].astype(np.float32)


def complete_clusters(points: npt.NDArray, is_event: Mask, is_object: Mask, parameters: Parameters) -> Mask:
    """Return (M,) bool: clusters of events, enough of the objects in their box, and what touches them there.

    points : (M, 3) metres, z up.   is_object : (M,) what is not ground; events on the ground are dropped.
    """
    out = np.zeros(len(points), bool)
    events, objects = np.flatnonzero(is_event & is_object), np.flatnonzero(is_object)
    if not len(events):
        return out
    cluster_of, voxel_of = label_regions(points[events], parameters.cluster_voxel, parameters.cluster_reach)
    for members in np.split(np.argsort(cluster_of, kind="stable"), np.cumsum(np.bincount(cluster_of))[:-1]):
        if len(np.unique(voxel_of[members])) < parameters.cluster_voxels:
            continue
        low, high = points[events[members]].min(axis=0), points[events[members]].max(axis=0)
        inside = objects[((points[objects] >= low) & (points[objects] <= high)).all(axis=1)]
        if is_event[inside].mean() >= parameters.cluster_share:
            region_of, _ = label_regions(points[inside], parameters.cluster_voxel, 1)
            out[inside[np.isin(region_of, region_of[is_event[inside]])]] = True
    return out
