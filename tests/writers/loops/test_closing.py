import json

import numpy as np
import pytest
from worlds import Block, record

from automos.core.geometry import inverse, make_transform, se3_exp
from automos.core.labels import Label
from automos.core.pose_files import read_poses
from automos.odometry.motion import chain
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.settings import LoopSettings, MapSettings
from automos.writers.maps.loops import closing
from automos.writers.maps.loops.closing import RINGS, SECTORS, close_loops
from automos.writers.maps.loops.places import compare_places, describe_place
from automos.writers.maps.make_map import make_map

LOOPS = LoopSettings()
RADIUS, STEP = 14.0, 1.6  # m


def houses(seed, centers):
    """Return houses, no two alike, where they are wanted."""
    rng = np.random.default_rng(seed)
    return tuple(
        Block((x, y, h / 2), (rng.uniform(3, 9), rng.uniform(3, 9), h), rng.uniform(0, 3))
        for (x, y), h in zip(centers, rng.uniform(3, 12, len(centers)), strict=True)
    )


def ring(radius, n, phase=0.0):
    a = phase + 2 * np.pi * np.arange(n) / n
    return np.stack([radius * np.cos(a), radius * np.sin(a)], axis=1)


def drifted(poses, slip, turn):
    """Return the poses with every step longer by the share `slip` and turned by `turn` rad more."""
    steps = inverse(poses[:-1]) @ poses[1:]
    steps[:, :3, 3] *= 1.0 + slip
    return chain(np.eye(4), steps @ se3_exp([0.0, 0.0, 0.0, 0.0, 0.0, turn]))


def trajectory_of(poses):
    n = len(poses)
    return Trajectory(poses, 0.1 * np.arange(n), np.zeros((n, 6)), SweepTiming(), make_transform(t=[0.0, 0.0, 1.8]))


def close(world, poses, **chosen):
    drifted = trajectory_of(poses)
    T_level_sensor, n_closed = close_loops(SequenceFrames(world.sequence, drifted), LoopSettings(**chosen))
    return inverse(drifted.T_level_world) @ T_level_sensor, n_closed


@pytest.fixture(scope="module")
def circle():
    """Once round a block and a quarter round again."""
    n = round(1.25 * 2 * np.pi * RADIUS / STEP)
    angle = STEP / RADIUS * np.arange(n)
    T = np.array(
        [make_transform([[-np.sin(a), -np.cos(a), 0], [np.cos(a), -np.sin(a), 0], [0, 0, 1]],
                        [RADIUS * np.cos(a), RADIUS * np.sin(a), 1.8]) for a in angle]
    )  # fmt: skip
    return record(houses(3, np.vstack([ring(26.0, 13), ring(6.0, 4), ring(44.0, 17, 0.1)])), T)


def test_a_drifted_round_is_closed_to_centimetres(circle):
    poses = drifted(circle.poses, 0.02, 0.0016)
    lap = round(2 * np.pi * RADIUS / STEP)

    def gap(T):  # how wrongly the end of the lap lies to its beginning
        error = inverse(inverse(circle.poses[0]) @ circle.poses[lap]) @ inverse(T[0]) @ T[lap]
        return float(np.linalg.norm(error[:3, 3]))

    assert gap(poses) > 1.0
    closed, n = close(circle, poses)
    assert n >= 3
    assert gap(closed) < 0.1
    steps, before = (inverse(T[:-1]) @ T[1:] for T in (closed, poses))
    assert np.linalg.norm((steps - before)[:, :3, 3], axis=1).max() < 0.06 * STEP  # bent evenly
    np.testing.assert_allclose(closed[0], np.eye(4), atol=1e-9)


@pytest.mark.slow
def test_a_map_with_its_loops_closed_has_each_wall_once(circle, tmp_path):
    frames = SequenceFrames(circle.sequence, trajectory_of(drifted(circle.poses, 0.02, 0.0016)))

    def made(is_closed):
        settings = MapSettings(voxel=0.4, max_range=30.0, loop_closure=is_closed)
        labels = lambda i, n: np.full(n, Label.STATIC)  # noqa: E731
        return make_map(frames, circle.sequence, labels, tmp_path, ["ply"], settings)

    closed, path = made(True), tmp_path / "poses.txt"
    assert json.loads((tmp_path / "map.json").read_text())["loops_closed"] >= 3
    poses, _ = close(circle, frames.trajectory.T_world_sensor)
    np.testing.assert_allclose(read_poses(path, len(poses)), poses, atol=1e-5)
    assert closed.n_points < 0.9 * made(False).n_points  # a fifth of the path was driven twice
    assert not path.exists()  # it is not that of this map


def test_a_street_without_revisits_stays_as_it_is(monkeypatch):
    rng = np.random.default_rng(5)
    along = [(x, side * rng.uniform(9, 14)) for x in np.arange(-20.0, 110.0, 11.0) for side in (-1, 1)]
    T = np.array([make_transform(t=[x, 0.0, 1.8]) for x in np.arange(0.0, 90.0, 1.5)])
    world = record(houses(4, along), T)
    poses = drifted(world.poses, 0.01, 0.0005)
    for name, lenient in {"MAX_OFFSET": 200.0, "MAX_DIFFERENCE": 1.0, "PLACE_EVERY": 10.0}.items():
        monkeypatch.setattr(closing, name, lenient)
    closed, n = close(world, poses)  # whatever is 50 m apart is tried
    assert n == 0
    np.testing.assert_array_equal(closed, poses)


def test_another_corner_that_looks_alike_is_refused(monkeypatch):
    # The same four houses twice, 60 m apart, with other surroundings: a place must fit as a whole.
    corner = [(-12.0, 9.0), (0.0, -9.0), (11.0, 10.0), (8.0, -11.0)]
    twice = (*houses(6, corner), *houses(6, [(x + 60.0, y) for x, y in corner]))
    others = houses(
        7, [(-25.0, -8.0), (-24.0, 12.0), (24.0, -12.0), (33.0, 14.0), (38.0, -9.0), (88.0, 8.0), (86.0, -13.0)]
    )
    T = np.array([make_transform(t=[x, 0.0, 1.8]) for x in np.arange(0.0, 66.0, 1.5)])
    world = record((*twice, *others), T)
    poses = world.poses
    for name, lenient in {"MAX_OFFSET": 200.0, "PLACE_SCANS": 1, "DEVIATION": 100.0}.items():
        monkeypatch.setattr(closing, name, lenient)
    assert close(world, poses, min_overlap=0.3)[1] > 0  # it does look alike
    closed, n = close(world, poses)
    assert n == 0
    np.testing.assert_array_equal(closed, poses)


def test_a_wrong_closure_that_looks_right_is_outvoted_by_the_path_driven(circle, monkeypatch):
    poses = circle.poses
    for name, lenient in {"MAX_DIFFERENCE": 1.0, "MAX_OFFSET": 200.0, "CANDIDATES": 1}.items():
        monkeypatch.setattr(closing, name, lenient)
    closed, n = close(circle, poses, min_overlap=0.05, min_distance=20.0)
    assert n >= 1
    assert np.linalg.norm((closed - poses)[:, :3, 3], axis=1).max() < 0.1


def test_a_place_is_known_again_from_another_heading():
    points = np.random.default_rng(0).uniform([-30, -30, 0], [30, 30, 0.2], (4000, 3))
    for x, y, h in ((10, 3, 5), (-7, 12, 8), (-20, -9, 3), (4, -16, 6)):
        points = np.vstack([points, np.random.default_rng(1).uniform([x, y, 0], [x + 4, y + 3, h], (800, 3))])
    turn = np.radians(90.0)
    c, s = np.cos(turn), np.sin(turn)
    seen = points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])  # from a frame that heads to its left
    a, b = (describe_place(p, LOOPS.reach, RINGS, SECTORS) for p in (points, seen))
    difference, found = compare_places(a, b)
    assert difference < 0.05
    assert found == pytest.approx(turn, abs=2 * np.pi / SECTORS)
    assert compare_places(a, np.zeros_like(a))[0] == 1.0


def test_a_place_is_described_by_the_heights_about_it():
    points = np.array([[5.0, 0.1, 0.0], [5.0, 0.1, 3.0], [-3.0, -0.1, 0.0], [-3.0, -0.1, 0.2]])
    # Two rings of 5 m, four sectors from +x: the post is in ring 1, sector 0; the kerb is none.
    np.testing.assert_allclose(describe_place(points, 10.0, 2, 4), [[0, 0, 0, 0], [3, 0, 0, 0]])
