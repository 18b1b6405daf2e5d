"""Every compiled kernel of the stages, called with points of any floats."""

from collections.abc import Callable

import numpy as np
from hostile_floats import SETTINGS, make_boxes, make_frame, make_pattern, make_tracks

from automos.baselines import erasor, erasor_bins
from automos.baselines.erasor_bins import fit_region_ground
from automos.core import covariances, directions
from automos.core.geometry import transform
from automos.core.range_image import find_neighbours, make_image, project
from automos.core.scan import GROUND, OBJECT, Scan
from automos.core.upright_boxes import iou_3d, points_in_boxes
from automos.core.voxel_map import VoxelMap, rows_of_first_in_voxel
from automos.evidence import ego_body, on_body, steady_ground, votes
from automos.evidence.clouds import in_clouds
from automos.evidence.ground import find_ground
from automos.evidence.look_through import look_through
from automos.objects import detect, places
from automos.objects.boxes import fit_boxes
from automos.objects.extents import headings
from automos.objects.face_paths import path_terms, way_beyond
from automos.objects.looks import share_first_looks
from automos.objects.motion import smooth
from automos.objects.object_points import paint_objects
from automos.objects.occlusion import hidden_sides, nearest_points
from automos.objects.outlines import outlines
from automos.objects.segments import segment_points
from automos.objects.states import state_probabilities
from automos.objects.tracks import Tracks, observed
from automos.odometry import drifting_seam, facing, point_order, submap
from automos.odometry import vertical as level
from automos.odometry.compensation import compensate
from automos.odometry.motion import usable_points
from automos.odometry.submap import fit_surfels, make_submap
from automos.odometry.surfels import make_surfels
from automos.odometry.sweep_timing import SweepTiming, azimuth_times


def _ground(points: np.ndarray) -> None:
    find_ground(points, points[0], SETTINGS.candidates.ground)
    # what lies nowhere at two ranges is no ground, so a floor is put below
    x, y = (axis.ravel() for axis in np.mgrid[-20:20:0.5, -20:20:0.5])
    floor = np.stack([x, y, np.full(x.shape, -1.7)], axis=-1).astype(points.dtype)
    find_ground(np.concatenate([floor, points]), np.zeros(3), SETTINGS.candidates.ground)
    steady_ground._means_around(np.resize(points[:, 2], (8, 8)), np.arange(64))


def _free_space(points: np.ndarray) -> None:
    directions.raw_points(make_frame(points))
    directions.last_looks(np.tile(points, (100, 1)), np.tile(points[:, 2], 100))
    n, motion, T = len(points), np.resize(points, 6), np.resize(points, (3, 4))
    for pattern in (make_pattern(np.resize(points[:, 0], 4097)), make_pattern()):
        projection = project(points, pattern, points[:, 0] == points[:, 0])
        in_clouds(points, find_neighbours(projection, np.ones(n, bool))[2], np.ones(n, bool))
        image = make_image(projection, pattern, motion, np.ones(n, bool))
        for each in (T, np.eye(4, dtype=np.float32)[:3]):
            looks = look_through(np.ascontiguousarray(points.T), each, image, (np.float32(0.1),) * 5)
            for ranges in (looks[1], points[:, 0].copy()):
                votes.weigh_looks(looks[0], ranges, points[:, 1], points[:, 2], np.ones(n), np.float32(0.02))


def _ego_body(points: np.ndarray) -> None:
    ego_body.find_constant(np.resize(points, (3, 4, 5)), SETTINGS.candidates.ego_body)
    for reach in (np.resize(points, (16, 64)), np.full((16, 64), np.float32(np.inf))):
        on_body.cells_within(points, reach, make_pattern())


def _erasor(points: np.ndarray) -> None:
    n = len(points)
    erasor_bins.polar_bins(points, erasor.Parameters(min_height=-1.0))
    ids, is_alive, scanned = np.arange(n), np.ones(n, bool), np.full(n, -1, np.int32)
    for version in (2, 3):
        parameters = erasor.Parameters(version=version, min_points=1)
        scan_ids = ids.astype(np.int32)
        erasor_bins.compare_bins(ids, points, is_alive, scanned, np.int32(1), points[::-1].copy(), scan_ids, parameters)
    fit_region_ground(points, 0.5, 2, 20, 3, 0.15)
    voxels = VoxelMap(0.2, points[0])
    voxels.add(points)
    voxels._reserve(1 << 16)
    assert len(voxels.mean) == len(voxels)
    rows_of_first_in_voxel(points, 0.5)


def _instances(points: np.ndarray) -> None:
    n, ids = len(points), (np.arange(len(points)) % 3 - 1).astype(np.int32)
    outlines(points, ids, fit_boxes(points, ids, np.ones(ids.max() + 1)))
    segment_points(points, points[:, 2], (0.02, 0.003), SETTINGS.instances.components.segments)
    hidden_sides(ids, nearest_points(points, (0.02, 0.003)), int(ids.max()) + 1)
    detect._summarise(ids, points, points[:, 2], np.full(n, 255, np.uint8), ids > 0, ids > 1)


def _tracking(points: np.ndarray) -> None:
    ids = (np.arange(len(points)) % 3 - 1).astype(np.int32)
    some = ids > 0
    tracks = make_tracks(points[:3])
    about = {"kind": np.where(some, np.uint8(GROUND), np.uint8(OBJECT)), "log_odds": np.where(some, -1.0, 1.0)}
    found, completion = {"ids": ids, "stayed": ids[::-1].copy()}, SETTINGS.tracking.completion
    paint_objects(points, about, found, tracks, observed(tracks), completion)
    box = Tracks(
        np.zeros(1, int),
        np.zeros(1, int),
        np.full(1, -1),
        np.zeros((1, 3)),
        np.ones((1, 3)),
        np.zeros(1),
        np.zeros((1, 3)),
    )
    paint_objects(points * np.float32(0.1), about, found, box, observed(box), completion, is_told_apart=True)
    smooth(np.arange(len(points)) * 0.1, points[:, 0].astype(float), np.full(len(points), 0.01), 1.0)
    smooth(np.arange(len(points)) * 0.1, np.full(len(points), np.nan), np.full(len(points), 0.01), 1.0)
    smooth(points[:, 1].astype(float), points[:, 0].astype(float), np.full(len(points), 0.01), 1.0)
    values = points.astype(float)
    columns = places.touched_columns(make_boxes(np.clip(np.nan_to_num(points), -50, 50)))
    places.held_places(points, some, ~some, columns)
    whole, even = np.array([0, len(points)]), np.array([0.5])
    state_probabilities(whole, np.arange(len(points)) * 0.1, values[:, 0].copy(), even, even, 0.01, 0.02)
    share_first_looks(values[:, 0].copy(), whole, np.arange(len(points)) * 0.1, np.ones(1, bool))
    path_terms(whole, np.arange(len(points)) * 0.1, np.hstack([values, values])[:, :4])
    headings(whole, np.arange(len(points)) * 0.1, values, values[:, 0], values[:, 1])
    way_beyond(whole, np.arange(len(points)) * 0.1, np.stack([values, values], axis=1)[..., :2], values[:, :2])


def _odometry(points: np.ndarray) -> None:
    about = SETTINGS.odometry
    times = azimuth_times(points, 1, float(points[0, 0]))
    compensate(points, times, np.resize(points, 6))
    for block in (1, 7):
        point_order._block_azimuths(points, block)
    point_order.turns_since_start(Scan(points), point_order.PointOrder(1, 1.0, 1.0))
    drifting_seam.gap_edges(points)
    for turns in (0.9, 1.1):
        drifting_seam.drifting_times(points, 1, turns)
    compensate(points, points[:, 0].copy(), np.ones(6))
    usable_points(Scan(points), SweepTiming(), np.zeros(6), about)
    shapes = np.ones((len(points), 6))
    level._score_planes(points.astype(float), shapes, points.astype(float), points[:, 0].astype(float))
    matrix, along, out = np.resize(points, 6).astype(float), np.resize(points, 3).astype(float), np.zeros((2, 3))
    covariances.eigenvalues(matrix)
    covariances.eigenvector(matrix, covariances.variance_along(matrix, along), out[0])
    covariances.across(matrix, along, out[0], out[1])
    hostile_T = np.eye(4)
    hostile_T[:3] = np.resize(points, (3, 4))
    covariance, axes = np.resize(points, 6).astype(np.float64), np.zeros((3, 3))
    covariances.eigenvector(covariance, covariances.eigenvalues(covariance)[0], axes[0])
    covariances.across(covariance, np.array([0.6, 0.0, 0.8]), axes[1], axes[2])
    surfels = make_surfels(points, times)
    for T in (np.eye(4), hostile_T):
        laid = make_submap([surfels, surfels], np.stack([np.eye(4), T]))
        fit_surfels(laid, surfels, T, 0.2, with_elevation=True)
        submap._rise(0.6, 0.0, 0.8, points[0])  # of surfels on a surface, which these are not
        submap._add_square(points[0].astype(float), 1.0, np.zeros((3, 3)))
        distances = np.resize(points, 5).astype(float)
        constrains, path = np.ones(len(laid.mean)), (np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
        facing._score(
            laid, constrains, (surfels.mean, surfels.covariance, surfels.time), T, path, distances, distances, 2.7
        )


def _geometry(points: np.ndarray) -> None:
    transform(np.resize(points, (4, 4)), points)
    points_in_boxes(points, make_boxes(points))
    iou_3d(make_boxes(points), make_boxes(points[::-1]))


STAGES: dict[str, Callable[[np.ndarray], None]] = {
    "geometry": _geometry,
    "ground": _ground,
    "free space": _free_space,
    "ego body": _ego_body,
    "erasor": _erasor,
    "instances": _instances,
    "tracking": _tracking,
    "odometry": _odometry,
}
"""What calls the kernels of a stage."""
