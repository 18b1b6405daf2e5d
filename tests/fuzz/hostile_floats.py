"""What damaged files hold where coordinates should be, and every compiled kernel called with it."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import automos
from automos.baselines import (
    depth_images,
    height_images,
    hmm_mos,
    m_detector,
    m_detector_parameters,
    occlusion_tests,
    octomap,
    range_image,
    removert,
    yoon,
)
from automos.baselines.brick_grid import BrickGrid
from automos.candidates import (
    ego_body_ranges,
    ego_body_votes,
    free_space_looks,
    free_space_vote,
    free_space_weigh,
)
from automos.candidates.free_space_image import find_neighbours, make_image, project, pyramid_shape
from automos.candidates.free_space_pattern import BeamPattern, raw_points
from automos.candidates.ground import fit_ground, is_on_ground
from automos.datasets import lzf, pcap, text, velodyne_sweeps
from automos.datasets import range_image as waymo_image
from automos.geometry import transform
from automos.instances import detect
from automos.instances.boxes import fit_boxes
from automos.instances.segments import segment_points
from automos.network import cleanup, projection, residuals
from automos.odometry import facing, level, registration, sweep_order
from automos.odometry import surfels as surfel_kernels
from automos.odometry.motion import SweepTiming, azimuth_times, compensate, gap_edges, usable_points
from automos.odometry.submap import fit_surfels, make_submap
from automos.odometry.surfels import make_surfels
from automos.paper import erasor, erasor_bins, hierarchy
from automos.paper.region_ground import fit_region_ground
from automos.scan import Frame, Scan
from automos.settings import load_settings
from automos.tracking import judge
from automos.tracking.completion import paint_objects
from automos.tracking.smoothing import smooth
from automos.tracking.tracks import Tracks
from automos.upright_boxes import Boxes, iou_3d, points_in_boxes
from automos.voxel_map import VoxelMap

SOURCE = Path(automos.__file__).parent
SETTINGS = load_settings("default")

_EDGES = (0.0, -0.0, 1e-45, 1e-38, 0.05, 1.0, 19_999.0, 2.0**31, 5e18, 9.3e18, 1.7e19, 1.9e19, 3.4e38, np.inf)
HOSTILE = (
    st.sampled_from([*_EDGES, *(-edge for edge in _EDGES), np.nan]) | st.floats(width=32) | st.floats(-60, 60, width=32)
)
CLOUDS = st.integers(1, 40).flatmap(lambda n: hnp.arrays(np.float32, (n, 3), elements=HOSTILE))
"""(N, 3) float32: ordinary numbers, those at which arithmetic or a whole number overflows, and no numbers."""


def _pattern(row_of_sine: np.ndarray | None = None) -> BeamPattern:
    rows = np.linspace(-2.0, 18.0, 4097, dtype=np.float32) if row_of_sine is None else row_of_sine
    return BeamPattern(16, 64, 0.02, 2.0 * np.pi / 64, rows, np.linspace(-0.5, 0.5, 360).astype(np.float32))


def _frame(points: np.ndarray) -> Frame:
    n = len(points)
    motion = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.1])
    return Frame(points, np.arange(n), n, np.eye(4), 0.0, points[:, 0].copy(), motion)


def _boxes(points: np.ndarray) -> Boxes:
    return Boxes(
        points.astype(float), np.roll(points, 1, 0).astype(float), points[:, 0].astype(float), np.ones(len(points))
    )


def _tracks(points: np.ndarray) -> Tracks:
    n, wide = len(points), points.astype(float)
    return Tracks(np.arange(n), np.zeros(n, int), np.arange(n) - 1, wide, np.roll(wide, 1, 0), wide[:, 0], wide)


def _ground(points: np.ndarray) -> None:
    surface = fit_ground(points, points[0], SETTINGS.candidates.ground)
    is_on_ground(points, points[0], surface, SETTINGS.candidates.ground)
    surface.height_at(points)


def _free_space(points: np.ndarray) -> None:
    raw_points(_frame(points))
    seen, _, _ = free_space_looks._latest_times(points, points[:, 2].copy(), 360)
    free_space_looks.is_last_look(points, points[:, 2].copy(), seen)
    pattern, kind = _pattern(), np.zeros(len(points), np.uint8)
    pyramid = pyramid_shape(pattern)
    for shape in (_pattern(np.resize(points[:, 0], 4097)), pattern):
        projection = project(points, kind == 0, shape)
        find_neighbours(projection, kind)
        image = make_image(projection, kind, pyramid)
    columns, motion, T = np.ascontiguousarray(points.T), np.resize(points, 6), np.resize(points, (3, 4))
    n = len(points)
    codes, ranges, misses = np.zeros(n, np.uint8), np.zeros(n, np.float32), np.zeros(n, np.float32)
    for each in (T, np.eye(4, dtype=np.float32)[:3]):
        for pattern in (_pattern(), _pattern(np.resize(points[:, 0], 4097))):
            arguments = (pattern, pyramid, image, (np.float32(0.1),) * 5, codes, ranges, misses)
            free_space_vote.look_through(columns, each, motion, *arguments)
    votes = np.zeros((3, n), np.int8)
    heights, own = points[:, 2], points[:, 1]
    free_space_weigh.weigh_looks(codes, own, misses, own, heights, 0.02, 0.1, 0.5, np.arange(n), votes[0])
    free_space_weigh.find_open(votes, np.ones(3, bool), 2)
    ids = free_space_weigh.find_seen_through(votes)
    free_space_weigh.weaken_lone(votes, ids, np.zeros(len(ids), bool), 0.5)
    free_space_weigh.sum_votes(votes, 1, 0.5, own.copy(), codes, codes.copy())


def _ego_body(points: np.ndarray) -> None:
    rows, image = _pattern().row_of_sine, np.zeros((16, 64), np.float32)
    ego_body_ranges._keep_nearest(points, np.float32(8.0), rows, image)
    ego_body_ranges.find_constant(np.resize(points, (3, 4, 5)), SETTINGS.candidates.ego_body)
    for reach in (np.resize(points, (16, 64)), np.full((16, 64), np.float32(np.inf))):
        ego_body_votes.cells_within(points, rows, reach, np.full(len(points), -1))


def _erasor(points: np.ndarray) -> None:
    n = len(points)
    erasor._voxels_near(points, points[0], np.float32(80.0))
    erasor_bins.polar_bins(points, erasor_bins.Volume(80.0, 20, 108, -1.0, 3.0))
    ids, is_alive, scanned = np.arange(n), np.ones(n, bool), np.full(n, -1, np.int32)
    for version in (2, 3):
        settings = SETTINGS.candidates.erasor.model_copy(update={"version": version})
        volume_and_rules = erasor._for_kernel(settings, erasor.PUBLISHED._replace(min_points=1))
        scan_ids = ids.astype(np.int32)
        erasor_bins.compare_bins(
            ids, points, is_alive, scanned, np.int32(1), points[::-1].copy(), scan_ids, *volume_and_rules
        )
    fit_region_ground(points, 0.5, 2, 20, 3, 0.15)
    voxels = VoxelMap(0.2, points[0])
    voxels.add(points)
    voxels._reserve(1 << 16)
    assert len(voxels.mean) == len(voxels)


def _instances(points: np.ndarray) -> None:
    n, ids = len(points), (np.arange(len(points)) % 3 - 1).astype(np.int32)
    fit_boxes(points, ids, np.ones(ids.max() + 1))
    segment_points(points, points[:, 2], points[:, 0], 0.02, 0.003, SETTINGS.instances.components.segments)
    detect._summarise(ids, points, ids > 0, ids > 1)
    hierarchy._summarise(np.zeros(n, np.int32), points[:, 0], points[:, 1], points)
    hierarchy._cut(2, np.array([[0.0, 1.0, points[0, 0], 2.0]]), np.array([2.0, 1.0]))


def _tracking(points: np.ndarray) -> None:
    ids = (np.arange(len(points)) % 3 - 1).astype(np.int32)
    some = ids > 0
    tracks = _tracks(points[:3])
    paint_objects(points, ids, ids[::-1].copy(), some, ~some, tracks, SETTINGS.tracking.completion)
    box = Tracks(
        np.zeros(1, int),
        np.zeros(1, int),
        np.full(1, -1),
        np.zeros((1, 3)),
        np.ones((1, 3)),
        np.zeros(1),
        np.zeros((1, 3)),
    )
    paint_objects(points * np.float32(0.1), ids, ids, np.ones_like(some), some, box, SETTINGS.tracking.completion)
    smooth(np.arange(len(points)) * 0.1, points[:, 0].astype(float), 0.01, 1.0)
    smooth(np.arange(len(points)) * 0.1, np.full(len(points), np.nan), 0.01, 1.0)
    smooth(points[:, 1].astype(float), points[:, 0].astype(float), 0.01, 1.0)
    values = points.astype(float)
    judge._add_up(np.array([0, len(points)]), np.hstack([values, values]), values[:, 0].copy(), np.zeros((1, 6)))


def _odometry(points: np.ndarray) -> None:
    about = SETTINGS.odometry
    times = azimuth_times(points, 1, float(points[0, 0]))
    compensate(points, times, np.resize(points, 6))
    for block in (1, 7):
        sweep_order._block_azimuths(points, block)
    for by in ("firing", "beam"):
        sweep_order.turns_since_start(Scan(points), sweep_order.PointOrder(by, 1, 1.0, 1.0))
    gap_edges(points)
    sweep_order._turns_by_beam(points, -1, float(points[0, 0]))
    compensate(points, points[:, 0].copy(), np.ones(6))
    usable_points(Scan(points), SweepTiming(), np.zeros(6), about)
    level._nearest_to_middle(points, level.RANGE, level.VOXEL)
    level._score_planes(points.astype(float), points.astype(float), points[:, 0].astype(float), 0.15)
    matrix, along, out = np.resize(points, 6).astype(float), np.resize(points, 3).astype(float), np.zeros((2, 3))
    surfel_kernels.eigenvalues(matrix)
    surfel_kernels.eigenvector(matrix, surfel_kernels.variance_along(matrix, along), out[0])
    surfel_kernels.across(matrix, along, out[0], out[1])
    hostile_T = np.eye(4)
    hostile_T[:3] = np.resize(points, (3, 4))
    icp = registration.Icp(registration.LocalMap(1.0, 20, 100.0), 0.5, 100.0)
    for T in (np.eye(4), np.eye(4), hostile_T):
        icp.register(points, T)
    covariance, axes = np.resize(points, 6).astype(np.float64), np.zeros((3, 3))
    surfel_kernels.eigenvector(covariance, surfel_kernels.eigenvalues(covariance)[0], axes[0])
    surfel_kernels.across(covariance, np.array([0.6, 0.0, 0.8]), axes[1], axes[2])
    surfels = make_surfels(points, times)
    for T in (np.eye(4), hostile_T):
        submap = make_submap([surfels, surfels], np.stack([np.eye(4), T]))
        fit_surfels(submap, surfels, T, 0.2)
        distances = np.resize(points, 5).astype(float)
        scores, way = np.zeros((2, 5)), np.array([1.0, 0.0, 0.0])
        facing._score(
            submap.arrays, surfels.mean, surfels.covariance, surfels.time, np.ascontiguousarray(T[:3, :3]),
            T[:3, 3].copy(), way, distances, distances, 2.7, scores,
        )  # fmt: skip


def _baselines(points: np.ndarray) -> None:
    is_member = np.arange(len(points)) % 2 == 0
    grid = BrickGrid(0.3, np.zeros((2, 3)), 40.0)
    ids = grid.add(points)
    passed = np.full(len(grid) + 1, -1, np.int32)
    grid.pass_rays(np.zeros(3), points, 1, passed)
    grid.pass_rays(points[0], points, 1, passed)
    grid.neighbours(ids[ids >= 0], grid.indices(), 1)
    octomap._update(points[:, 0].copy(), ids, ids, 0, 0.1, -0.1, -2.0, 2.0)
    height_images.find_ground(points, height_images.HeightImages(reach=4.0))
    shape = range_image.image_shape(2.0, 4.0, -60.0, 60.0)
    seen = range_image.nearest_ranges(points, shape)
    range_image.shortest_around(seen, 1, 1)
    for T in (np.eye(4, dtype=np.float32)[:3], np.resize(points, (3, 4))):
        for only_nearest in (False, True):
            removert._mark_seen_through(points, T, seen, shape, 80.0, 0.1, only_nearest, is_member.copy())
    yoon._find_free(points, seen, shape, 0.3, 60.0, is_member.copy())
    yoon._has_company(points, is_member, shape, 2, 2)


def _occlusion(points: np.ndarray) -> None:
    ordinary = np.random.default_rng(0).normal(0.0, (8.0, 8.0, 1.0), (60, 3)).astype(np.float32)
    tests = m_detector._Tests(m_detector_parameters.KITTI, range_image.image_shape(2.0, 4.0, -60.0, 60.0))
    hostile_T = np.vstack([np.resize(points, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
    for cloud, T in ((points, np.eye(4)), (ordinary, np.eye(4)), (ordinary, hostile_T)):
        there = T[:3].astype(np.float32)
        for shares in ((0.8, 0.6), (2.0, 1.8)):  # what went away, and what is hidden now
            images = [
                depth_images.draw(each, np.arange(len(each)) % 5 == 4, T, -0.1 * i, tests._shape)
                for i, each in enumerate([cloud * np.float32(shares[0]), cloud * np.float32(shares[1]), points])
            ]
            for stamp in (0.1, 0.0):  # at the same time as the newest: no speed
                tests.find_events(_frame(cloud), stamp, images)
            past, asked = depth_images.stack(images[:2]), np.ones(len(cloud), bool)
            crossing = tests._crossing._replace(images=1)
            occlusion_tests.find_crossing(cloud, asked, np.stack([there] * 2), past, crossing, tests._shape)
            for case in tests._along:
                far = case._replace(depth=0.0, share=0.0, reach=1e30, max_acceleration=1e30)
                along = (cloud, asked, there[None], there, np.array([0.1, 0.1]), past, past, far, tests._shape)
                occlusion_tests.find_along_ray(*along)


def _hidden_states(points: np.ndarray) -> None:
    n = len(points)
    belief, state = np.abs(points), np.zeros(n, np.int8)
    hmm_mos._filter(np.arange(n), points[:, 0], belief, state, 0.005, 0.99)
    hmm_mos._filter(np.arange(n), points[:, 0], np.zeros((n, 3), np.float32), state, 0.005, 0.99)


def _network(points: np.ndarray) -> None:
    for grid in (projection.even_grid(16, 64, 3.0, -25.0), projection.ImageGrid(16, 64, np.resize(points, 4097))):
        pixels, ranges = projection.project(points, grid)
        index = projection.nearest_points(pixels, ranges, grid.size)
        now = np.resize(points[:, 0], (16, 64))
        residuals.residual_images(now, [points], np.stack([np.eye(4)]), grid)
        residuals.residual_images(now, [points], np.resize(points, (1, 4, 4)), grid)
        image = SimpleNamespace(pixels=pixels, ranges=ranges, channels=np.stack([now]), index=index)
        cleanup.vote(image, np.resize(points[:, 1], (16, 64)))


def _geometry(points: np.ndarray) -> None:
    transform(np.resize(points, (4, 4)), points)
    points_in_boxes(points, _boxes(points))
    iou_3d(_boxes(points), _boxes(points[::-1]))


def _datasets(points: np.ndarray) -> None:
    pose = np.resize(points, (2, 3, 6)).astype(np.float32)
    waymo_image.place_pixels(pose[..., 0].copy(), pose, np.resize(points, 2).astype(float), np.eye(4), np.eye(4))
    raw = points.tobytes()
    data = np.frombuffer(raw, np.uint8)
    for n_bytes in (0, 8, 300):
        lzf._decompress(data, np.empty(n_bytes, np.uint8))
    for is_big in (False, True):
        packets = [np.empty(len(data), kind) for kind in (np.int64, np.int64, np.float64, np.int64)]
        pcap._walk(data, 8, is_big, 1e-6, 14, *packets)
        data = np.concatenate([np.array([0x45, 0, 0, 0, 0, 0, 0, 0, 0, 17], np.uint8), data])  # IPv4, UDP
        record = np.array([0, 0, len(data), len(data)], ">u4" if is_big else "<u4").view(np.uint8)
        pcap._walk(np.concatenate([record, data]), 8, is_big, 1e-6, 0, *packets)
    velodyne_sweeps._mark_first(points[:, 0], points[:, 1], np.zeros(3), np.zeros(len(points), bool))
    for written in (raw, " ".join(map(str, points.ravel())).encode()):
        try:
            text.parse_table(written)
        except ValueError:
            continue


ROOMS: dict[str, Callable[[np.ndarray], None]] = {
    "geometry": _geometry,
    "ground": _ground,
    "free space": _free_space,
    "ego body": _ego_body,
    "erasor": _erasor,
    "instances": _instances,
    "tracking": _tracking,
    "odometry": _odometry,
    "baselines": _baselines,
    "occlusion": _occlusion,
    "hidden states": _hidden_states,
    "network": _network,
    "datasets": _datasets,
}
"""What calls the kernels of a room with hostile points."""


WHOLE_NUMBERS = {"_keep_nearest"}
"""Kernels that take no floats."""


def kernels() -> Iterator[tuple[Path, str]]:
    """Yield the file and name of every compiled kernel that may be given what was read."""
    for path in sorted(set(SOURCE.rglob("*.py")) - set((SOURCE / "simulation").rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text())):
            if (
                isinstance(node, ast.FunctionDef)
                and any("njit" in ast.unparse(d) for d in node.decorator_list)
                and node.name not in WHOLE_NUMBERS
            ):
                yield path, node.name
