"""M-detector: a point that hides what was seen a moment ago has moved, and so has what goes behind or before itself.

Our reading of Wu, Li, Xu, Kong, Zhang, "Moving event detection from LiDAR point streams" (Nature Communications 2024)
with the authors' parameters for the sensor whose rays lie apart most like those of the one at hand, scan by scan;
pixels are no finer than rays and depth images no closer in time than scans, as the authors ask (README, lines 98 to
104). Past scans are depth images that keep their points. Points that pass one of three tests are events; clusters of
them are completed to objects, and what was found is no longer taken for something that stood ("frame-out", "cluster
future"). Only the past is used.

Parameters have their names and lines in github.com/hku-mars/M-detector: config/kitti/kitti0.yaml at 0645dab (HDL-64E)
and config/nuscenes/nuscenes0.yaml at e125a9d (HDL-32E). No other number is in the method but what follows from the
sensor: for KITTI's the file gives a view from -23 to 2 degrees (lines 22, 23), two degrees less than the sensor's own.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.baselines.batches import scans_at
from automos.baselines.depth_images import DepthImage, Window, draw, stack
from automos.baselines.occlusion_tests import AlongRay, Crossing, find_along_ray, find_crossing, leave_out_standing
from automos.baselines.range_image import ImageShape, pattern_of, shape_of
from automos.baselines.regions import label_regions
from automos.core.geometry import inverse
from automos.core.scan import Frame, Frames, Mask
from automos.evidence.ground import find_ground
from automos.settings import GroundSettings


@dataclass(frozen=True)
class Parameters:
    """Depth images, the three tests, clusters.

    Attributes
    ----------
    images : int
        Past depth images asked.
    gap : float
        Seconds between them, of faster sensors.
    row, column : float
        Rad, pixel of a depth image in elevation and azimuth.
    blind : float
        Metres, nearer points are not events.
    crossing, away, nearer : Crossing and AlongRay
        The tests; windows are for pixels of `row` x `column`.
    cluster_voxel : float
        Metres.
    cluster_reach : int
        Voxels, over which events are of one cluster.
    cluster_voxels : int
        Voxels that make a cluster.
    cluster_share : float
        Of the objects' points in its box that are events.
    """

    images: int
    gap: float
    row: float
    column: float
    blind: float
    crossing: Crossing
    away: AlongRay
    nearer: AlongRay
    cluster_voxel: float
    cluster_reach: int
    cluster_voxels: int
    cluster_share: float


def _of_file(number: int) -> Parameters:
    """Return the parameters of the file for KITTI (0) or nuScenes (1): where these differ, values and lines of both."""

    def of(*values: Any) -> Any:
        return values[number]

    return Parameters(
        images=of(15, 10),  # max_depth_map_num, 14, 12
        gap=of(0.1, 0.2),  # depth_map_dur, 13, 11
        row=of(0.007, 0.022),  # ver_resolution_max, 104, 103
        column=of(0.005, 0.007),  # hor_resolution_max, 105, 104
        blind=of(0.3, 0.2),  # blind_dis, 21, 19
        crossing=Crossing(
            depth=0.15,  # depth_thr1, 29
            images=2,  # occluded_map_thr1, 44
            stands=Window(0.01, of(0.015, 0.03), 0.15),  # map_cons_hor_thr1, _ver_thr1, _hor_dis1, 33 to 36, 30 to 32
            tolerance=of(0.15, 0.3),  # map_cons_depth_thr1, 32, 29
            surface=of(0.5, 1.5),  # interp_thr1, 80, 78
            surface_from=of(10.0, 15.0),  # interp_start_depth1, 82, 80
            surface_slope=of(0.1, 0.15),  # interp_kp1, 83, 81
            surface_window=Window(0.015, of(0.007, 0.06)),  # interp_hor_thr, interp_ver_thr, 78 and 79, 76 and 77
            surface_reach=10.0,  # interp_static_max, 81
        ),
        away=AlongRay(
            sign=1.0,
            same=Window(0.01, of(0.015, 0.04)),  # occ_hor_thr2, occ_ver_thr2, 53 and 54, 50 and 51
            depth=0.0,
            share=0.005,  # k_depth2, 60
            reach=10.15,  # occ_depth_thr2, 52
            min_speed=1.0,  # v_min_thr2, 47
            max_acceleration=7.0,  # acc_thr2, 48
            stands=Window(0.01, of(0.01, 0.03)),  # map_cons_hor_thr2, _ver_thr2, 50 and 51, 47 and 48
            tolerance=0.2,  # map_cons_depth_thr2, 49
            even=Window(0.01, of(0.01, 0.03)),  # depth_cons_hor_thr2, _ver_thr2, 57 and 58, 54 and 55
            even_depth=0.1,  # depth_cons_depth_thr2, 55
            even_reach=0.5,  # depth_cons_depth_max_thr2, 56
        ),
        nearer=AlongRay(
            sign=-1.0,
            same=Window(0.01, of(0.01, 0.04)),  # occ_hor_thr3, occ_ver_thr3, 69 and 70, 66 and 67
            depth=0.15,  # occ_depth_thr3, 68
            share=of(0.0, 0.005),  # k_depth3, absent, 73
            reach=math.inf,
            min_speed=0.5,  # v_min_thr3, 63
            max_acceleration=15.0,  # acc_thr3, 64
            stands=Window(0.01, of(0.008, 0.03)),  # map_cons_hor_thr3, _ver_thr3, 66 and 67, 63 and 64
            tolerance=0.2,  # map_cons_depth_thr3, 65
            even=Window(0.01, of(0.01, 0.03)),  # depth_cons_hor_thr3, _ver_thr3, 73 and 74, 70 and 71
            even_depth=0.3,  # depth_cons_depth_thr3, 71
            even_reach=1.0,  # depth_cons_depth_max_thr3, 72
        ),
        cluster_voxel=0.3,  # cluster_Voxel_revolusion, 99, absent
        cluster_reach=of(2, 3),  # cluster_extend_pixel, 96, 93
        cluster_voxels=of(8, 3),  # cluster_min_pixel_number, 97, 94
        cluster_share=0.3,  # cluster_thrustable_thresold, 98, absent
    )


FILES = KITTI, NUSCENES = _of_file(0), _of_file(1)


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
    gap = max(parameters.gap, float(np.median(np.diff(stamps)))) if len(stamps) > 1 else parameters.gap
    lags = gap * np.arange(1, parameters.images + 1)
    warm_up = min([*scans_at(stamps, start, -2.0 * lags), start])
    past: dict[int, DepthImage] = {}
    for k in range(warm_up, len(frames)):
        frame, asked = frames[k], scans_at(stamps, k, -lags)
        past = {j: image for j, image in past.items() if j >= min([*asked, k])}
        images = [past[j] for j in asked if j in past]
        is_event = find_events(frame, float(stamps[k]), images, parameters, shape)
        is_object = ~find_ground(frame.points_level, frame.origin_level, ground)[0]
        is_moving = complete_clusters(frame.points_level, is_event, is_object, parameters)
        past[k] = draw(frame.points, is_moving, frame.T_level_sensor, float(stamps[k]), shape)
        if k >= start:
            yield k, is_moving


def find_events(
    frame: Frame, stamp: float, images: list[DepthImage], parameters: Parameters, shape: ImageShape
) -> Mask:
    """Return (M,) bool: the frame's points that pass any of the tests; `images` are from new to old."""
    points, along = frame.points, (parameters.away, parameters.nearer)
    is_asked = np.sqrt(np.einsum("ij,ij->i", points, points)) > parameters.blind
    if not images:
        return np.zeros_like(is_asked)
    past = stack(images)
    T = np.stack([_between(image.T_level_sensor, frame.T_level_sensor) for image in images])
    is_event = find_crossing(points, is_asked, T, past, parameters.crossing, shape)
    if len(images) > 1:
        # what agrees within the smaller of their windows stands for cases 2 and 3
        width, height = (min(case.stands[i] for case in along) for i in (0, 1))
        plainly = min(case.tolerance for case in along)
        leave_out_standing(points, is_asked, T, past, Window(width, height), plainly, _PREFILTER, shape)
        now = stack([draw(points, np.zeros_like(is_asked), frame.T_level_sensor, stamp, shape)])
        T_between = _between(images[1].T_level_sensor, images[0].T_level_sensor)
        gaps = -np.diff([stamp, images[0].stamp, images[1].stamp])
        for case in along:
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
