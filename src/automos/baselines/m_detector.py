"""M-detector: a point that hides what was seen a moment ago has moved, and so has what goes behind or before itself.

Our reading of Wu, Li, Xu, Kong, Zhang, "Moving event detection from LiDAR point streams" (Nature Communications 2024)
with the authors' parameters for KITTI, scan by scan. Past scans are depth images that keep their points. Points that
pass one of three tests are events; clusters of them are completed to objects, and what was found is no longer taken for
something that stood ("frame-out", "cluster future"). Only the past is used.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from automos.baselines.depth_images import DepthImage, Stack, Window, draw, stack
from automos.baselines.event_clusters import complete_clusters
from automos.baselines.neighbours_in_time import scans_at
from automos.baselines.occlusion_tests import AlongRay, Crossing, find_along_ray, find_crossing, leave_out_standing
from automos.baselines.range_image import ImageShape, shape_for
from automos.candidates.ground import segment_ground
from automos.geometry import inverse
from automos.scan import Frame, Frames, Mask
from automos.settings import AlongRaySettings, GroundSettings, MDetectorSettings

_PREFILTER = 2
"""Images in which most of what stands is found, before the tests are asked."""


def find_moving(
    frames: Frames, stamps: npt.NDArray, settings: MDetectorSettings, ground: GroundSettings, start: int = 0
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order. `stamps` (N,) are their times, s."""
    shape = shape_for(frames, float(np.degrees(settings.row)), float(np.degrees(settings.column)))
    tests = _Tests(settings, shape)
    lags = settings.gap * np.arange(1, settings.images + 1)
    warm_up = min([*scans_at(stamps, start, -2.0 * lags), start])
    past: deque[tuple[int, DepthImage]] = deque()
    for k in range(warm_up, len(frames)):
        frame, asked = frames[k], scans_at(stamps, k, -lags)
        while past and past[0][0] < min([*asked, k]):
            past.popleft()
        images = [image for j in asked for i, image in past if i == j]
        is_event = tests.find_events(frame, float(stamps[k]), images)
        is_object = ~segment_ground(frame.points_level, frame.origin_level, ground)
        is_moving = complete_clusters(frame.points_level, is_event, is_object, settings)
        past.append((k, draw(frame.points, is_moving, frame.T_level_sensor, float(stamps[k]), shape)))
        if k >= start:
            yield k, is_moving


class _Tests:
    """The three tests with their windows, made as wide as the sensor asks for."""

    def __init__(self, settings: MDetectorSettings, shape: ImageShape):
        self._shape, self._min_range = shape, settings.min_range
        self._wider = 2.0 * np.pi / shape.columns / settings.column
        self._higher = shape.row_height / settings.row
        away, nearer = settings.away, settings.nearer
        self._crossing = Crossing(
            settings.depth,
            settings.hidden_images,
            self._window(settings.stands_width, settings.stands_height, settings.stands_metres),
            settings.tolerance,
            self._window(settings.surface_width, settings.surface_height),
            settings.surface_near,
            settings.surface_from,
            settings.surface_far,
            settings.surface_per_metre,
            settings.surface_reach,
        )
        self._along = (self._along_ray(1.0, away), self._along_ray(-1.0, nearer))
        # what agrees within the smallest of the tests' windows stands for all of them
        self._prefilter = self._window(
            min(settings.stands_width, away.stands_width, nearer.stands_width),
            min(settings.stands_height, away.stands_height, nearer.stands_height),
        )
        self._plainly = min(settings.tolerance, away.tolerance, nearer.tolerance)

    def _window(self, width: float, height: float, metres: float = 0.0) -> Window:
        return Window(float(width * self._wider), float(height * self._higher), float(metres))

    def _along_ray(self, sign: float, about: AlongRaySettings) -> AlongRay:
        return AlongRay(
            sign,
            self._window(about.width, about.height),
            about.depth,
            about.share,
            about.reach,
            about.min_speed,
            about.max_acceleration,
            self._window(about.stands_width, about.stands_height),
            about.tolerance,
            self._window(about.even_window, about.even_window),
            about.even_depth,
            about.even_reach,
        )

    def find_events(self, frame: Frame, stamp: float, images: list[DepthImage]) -> Mask:
        """Return (M,) bool: the frame's points that pass any of the tests; `images` are from new to old."""
        points, shape = frame.points, self._shape
        is_asked = np.einsum("ij,ij->i", points, points) > self._min_range**2
        if not images:
            return np.zeros_like(is_asked)
        past = stack(images)
        T = np.stack([_between(image.T_level_sensor, frame.T_level_sensor) for image in images])
        leave_out_standing(points, is_asked, T, past, self._prefilter, self._plainly, _PREFILTER, shape)
        is_event = find_crossing(points, is_asked, T, past, self._crossing, shape)
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
