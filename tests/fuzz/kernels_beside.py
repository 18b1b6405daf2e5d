"""Every compiled kernel of readers, networks and other methods, called with points of any floats."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
from hostile_floats import make_frame

from automos.baselines import (
    depth_images,
    height_images,
    hmm_mos,
    m_detector,
    occlusion_tests,
    octomap,
    range_image,
    removert,
    yoon,
)
from automos.baselines.brick_grid import BrickGrid
from automos.network import cleanup, images, projection
from automos.readers import lzf
from automos.readers import range_image as waymo_image
from automos.readers.packets import pcap, sweeps


def _baselines(points: np.ndarray) -> None:
    is_member = np.arange(len(points)) % 2 == 0
    grid = BrickGrid(0.3, np.zeros((2, 3)), 40.0)
    ids = grid.add(points)
    passed = np.full(len(grid) + 1, -1, np.int32)
    grid.pass_rays(np.zeros(3), points, 1, passed)
    grid.pass_rays(points[0], points, 1, passed)
    grid.neighbours(ids[ids >= 0], grid.indices(), 1)
    grid.pass_lines(np.zeros(3), grid.indices()[ids[ids >= 0]], 1, passed)
    grid.squared_steps(ids[ids >= 0], grid.indices(), 1)
    octomap._update(points[:, 0].copy(), ids, ids, 0, 0.1, -0.1, -2.0, 2.0)
    height_images.find_ground(points, height_images.HeightImages(reach=4.0))
    shape = range_image.image_shape(2.0, 4.0, -60.0, 60.0)
    seen = range_image.nearest_ranges(points, shape)
    for T in (np.eye(4, dtype=np.float32)[:3], np.resize(points, (3, 4))):
        for only_nearest in (False, True):
            removert._mark_seen_through(points, T, seen, shape, 80.0, 0.1, only_nearest, is_member.copy())
    yoon._find_free(points, seen, shape, 0.3, 60.0, is_member.copy())
    yoon._has_company(points, is_member, shape, 2, 2)


def _occlusion(points: np.ndarray) -> None:
    ordinary = np.random.default_rng(0).normal(0.0, (8.0, 8.0, 1.0), (60, 3)).astype(np.float32)
    about, shape = m_detector.KITTI, range_image.image_shape(2.0, 4.0, -60.0, 60.0)
    hostile_T = np.vstack([np.resize(points, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
    for cloud, T in ((points, np.eye(4)), (ordinary, np.eye(4)), (ordinary, hostile_T)):
        there = T[:3].astype(np.float32)
        for shares in ((0.8, 0.6), (2.0, 1.8)):  # what went away, and what is hidden now
            images = [
                depth_images.draw(each, np.arange(len(each)) % 5 == 4, T, -0.1 * i, shape)
                for i, each in enumerate([cloud * np.float32(shares[0]), cloud * np.float32(shares[1]), points])
            ]
            for stamp in (0.1, 0.0):  # at the same time as the newest: no speed
                m_detector.find_events(make_frame(cloud), stamp, images, about, shape)
            past, asked = depth_images.stack(images[:2]), np.ones(len(cloud), bool)
            crossing = about.crossing._replace(images=1)
            occlusion_tests.find_crossing(cloud, asked, np.stack([there] * 2), past, crossing, shape)
            for case in (about.away, about.nearer):
                far = case._replace(depth=0.0, share=0.0, reach=1e30, max_acceleration=1e30)
                along = (cloud, asked, there[None], there, np.array([0.1, 0.1]), past, past, far, shape)
                occlusion_tests.find_along_ray(*along)


def _hidden_states(points: np.ndarray) -> None:
    n = len(points)
    seen, away, state, changed = np.zeros(n, np.int32), np.zeros(n, np.uint8), np.zeros(n, np.int8), np.full(n, -1)
    for surface in (np.linspace(0.0, 1.0, 256), np.resize(points[:, 1], 256).astype(float)):
        hmm_mos._filter(0, seen, away, points[:, 0].astype(float), state, changed, surface, 0.005, 0.99)
    around = np.resize(np.array([0, -1, n - 1], np.int32), (n, 3))
    hmm_mos._count(around, 0, state, seen, seen, changed, -1)
    hmm_mos._median(around, np.ones(n, bool), seen)


def _network(points: np.ndarray) -> None:
    beams = projection.beam_grid(16, 64, np.linspace(0.0, 16.0, projection.SINE_BINS + 1), 16)
    for grid in (beams, projection.ImageGrid(16, 64, np.resize(points, 4097))):
        pixels, ranges = projection.project(points, grid)
        index = projection.nearest_points(pixels, ranges, grid.size)
        now = np.resize(points[:, 0], (16, 64))
        images.residual_images(now, [points], np.stack([np.eye(4)]), grid)
        images.residual_images(now, [points], np.resize(points, (1, 4, 4)), grid)
        image = SimpleNamespace(pixels=pixels, ranges=ranges, channels=np.stack([now]), index=index)
        cleanup.vote(image, np.resize(points[:, 1], (16, 64)))


def _datasets(points: np.ndarray) -> None:
    pose = np.resize(points, (2, 3, 6)).astype(np.float32)
    waymo_image.place_pixels(pose[..., 0].copy(), pose, np.resize(points, 2).astype(float), np.eye(4), np.eye(4))
    raw = points.tobytes()
    data = np.frombuffer(raw, np.uint8)
    for n_bytes in (0, 8, 300):
        lzf._decompress(data, np.empty(n_bytes, np.uint8))
    for is_big in (False, True):
        packets = [np.empty(len(data), kind) for kind in (np.int64, np.int64, np.float64, np.int64)]
        for is_ng in (False, True):
            pcap._walk(data, 8, is_big, is_ng, np.array([1e-6]), np.array([14]), *packets)
        data = np.concatenate([np.array([0x45, 0, 0, 0, 0, 0, 0, 0, 0, 17], np.uint8), data])  # IPv4, UDP
        record = np.array([0, 0, len(data), len(data)], ">u4" if is_big else "<u4").view(np.uint8)
        pcap._walk(np.concatenate([record, data]), 8, is_big, False, np.array([1e-6]), np.array([0]), *packets)
    sweeps._mark_first(points[:, 0], points[:, 1], np.zeros(3), np.zeros(len(points), bool))


BESIDE: dict[str, Callable[[np.ndarray], None]] = {
    "baselines": _baselines,
    "occlusion": _occlusion,
    "hidden states": _hidden_states,
    "network": _network,
    "datasets": _datasets,
}
"""What calls the kernels of what lies beside the stages."""
