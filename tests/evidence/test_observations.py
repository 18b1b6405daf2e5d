import numpy as np
from free_space_worlds import HEIGHT, ListFrames, within
from worlds import Block, cast, van

from automos.core.beam_pattern import Lidar, make_pattern
from automos.core.geometry import make_transform
from automos.core.scan import OBJECT, SPECK, Frame
from automos.evidence.free_space import FreeSpace
from automos.evidence.ground import map_ground
from automos.evidence.observations import look
from automos.settings import CandidatesSettings, GroundSettings

MOUNTS = np.stack([make_transform(t=[0.0, 2.0, 0.0]), make_transform(t=[-6.0, -2.0, -0.6])])
"""Two LiDARs of a lorry: above the left door, and behind on the right."""
HOUSES = tuple(Block((9.0 * k, side, 3.0), (6.0 + k % 3, 4.0, 6.0)) for k in range(-4, 9) for side in (-13.0, 13.0))
POSTS = tuple(Block((4.0 * k, side, 1.5), (0.3, 0.3, 3.0)) for k in range(-4, 9) for side in (-7.0, 6.0))
PASSING = van(-12.0, 4.5, speed=9.0)


def merged(mounts, n_scans=30):
    """Return frames of both LiDARs' points in one cloud, said to come from `mounts` (or from the origin: None)."""
    azimuth = 2.0 * np.pi * (np.arange(720) + 0.5) / 720
    e, a = (grid.ravel() for grid in np.meshgrid(np.radians(np.linspace(-20.0, 6.0, 24)), azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    frames = []
    for i in range(n_scans):
        T, points, sensor = make_transform(t=[0.2 * i, 0.0, HEIGHT]), [], []
        for k, mount in enumerate(MOUNTS):
            distance, _ = cast((*HOUSES, *POSTS, PASSING), (T @ mount)[:3, 3], rays, 0.1 * i)
            seen = distance < 60.0
            noise = np.random.default_rng(100 * i + k).normal(0.0, 0.01, seen.sum())
            points.append(mount[:3, 3] + (distance[seen] + noise)[:, None] * rays[seen])
            sensor.append(np.full(seen.sum(), k, np.uint8))
        cloud = np.concatenate(points).astype(np.float32)
        said = {} if mounts is None else {"sensor": np.concatenate(sensor), "T_scan_sensor": mounts}
        frames.append(Frame(cloud, np.arange(len(cloud)), len(cloud), T, 0.1 * i, **said))
    return ListFrames(frames)


def evidence_of(frames):
    return FreeSpace(frames, frames.stamps, CandidatesSettings()).collect()


def moved_shares(frames):
    """Return the shares of the points of the van, and of all else, that have moved."""
    of_van, others = [], []
    for i, _, net in evidence_of(frames):
        on_van = within(frames[i], PASSING, frames[i].stamp)
        of_van.append(net[on_van] >= 1.0)
        ahead = frames[i].points_level[:, 0] - (PASSING.center[0] + PASSING.velocity[0] * frames[i].stamp)
        on_its_lane = (np.abs(ahead) < 4.0) & (np.abs(frames[i].points_level[:, 1] - PASSING.center[1]) < 1.3)
        others.append(net[~on_its_lane] >= 1.0)
    return np.concatenate(of_van).mean(), np.concatenate(others).mean()


def test_free_space_is_asked_of_where_each_ray_started():
    van_moved, rest_moved = moved_shares(merged(MOUNTS))
    assert van_moved > 0.98
    assert rest_moved < 1e-5
    van_moved, _ = moved_shares(merged(None))
    assert van_moved < 0.9  # what the mounts are for


def test_a_frame_gives_each_lidar_its_points_and_its_motion():
    T = make_transform(t=[1.0, 0.0, 0.0])
    mounts = np.stack([np.eye(4), make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [0.0, 2.0, 0.0])])
    points = np.array([[5, 0, 0], [0, 7, 0]], np.float32)
    turning = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.1])
    frame = Frame(
        points, np.array([3, 8]), 9, T, 0.0, np.zeros(2, np.float32), turning, np.array([0, 1], np.uint8), mounts
    )
    rows, part = frame.of_sensor(1)
    assert rows.tolist() == [1]
    assert part.kept.tolist() == [8]
    np.testing.assert_allclose(part.points, [[5.0, 0.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(part.points_level, [[1.0, 7.0, 0.0]], atol=1e-6)
    # Two metres to the left of the centre it turns about, it goes backwards at 0.2: sideways in its own axes.
    np.testing.assert_allclose(part.sweep_motion, [0.0, 0.2, 0.0, 0.0, 0.0, 0.1], atol=1e-12)


def test_points_of_both_turns_of_a_scan_have_neighbours_of_their_own_turn():
    azimuth, elevation = 2.0 * np.pi * (np.arange(720) + 0.5) / 720 - np.pi, np.radians(np.arange(-3.5, 4.5))
    e, a = (grid.ravel() for grid in np.meshgrid(elevation, azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    walls, time = np.concatenate([12.0 * rays, 10.0 * rays]), np.linspace(-0.5, 0.5, 2 * len(rays))
    drop = 1005  # of rain, half a degree above the horizon, in the first turn
    walls[drop] *= 0.5
    points = walls.astype(np.float32)
    T = make_transform(t=[0.0, 0.0, 2.0])
    frame = Frame(points, np.arange(len(points)), len(points), T, 0.0, time.astype(np.float32), np.zeros(6))
    pattern = make_pattern(elevation, 2.0 * np.pi / 720)
    ground = map_ground(frame.points_level, frame.origin_level, GroundSettings())
    seen = look(frame, [Lidar(0, np.eye(4), pattern)], ground, GroundSettings())
    assert np.flatnonzero(seen.kind == SPECK).tolist() == [drop]
    assert seen.solidity[drop] == 0
    first, second = np.split(np.where(seen.kind == OBJECT, seen.solidity, 255), 2)
    assert second.min() == 255
    assert (first < 255).sum() == 8  # those beside the drop
