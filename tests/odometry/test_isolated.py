"""Isolated points: what is one, and at which distance travelled they are met again."""

from dataclasses import replace

import numpy as np
import pytest
from raw_worlds import curve
from worlds import Block, record

from automos.odometry.estimate import estimate_trajectory
from automos.odometry.isolated import count_met_again, isolated_points
from automos.odometry.speed import search_speed
from automos.odometry.surfels import surfels_of
from automos.odometry.window import Window
from automos.settings import OdometrySettings
from automos.simulation import simulate

FORWARD = np.array([1.0, 0.0, 0.0])
POSTS = np.array([[-8.0, 15.0, 1.0], [0.0, 15.0, 1.0], [13.0, -18.0, 0.5]], np.float32)
DISTANCES = np.arange(-2.0, 6.0, 0.1)


def isolated(points, times=None):
    return isolated_points(surfels_of(np.asarray(points, np.float32), times), FORWARD, overhead=3.0, beside=12.0)


def met_again(here, there, travelled=0.0, share=0.0):
    T = np.eye(4)
    T[0, 3] = travelled
    return count_met_again(here, there, T, FORWARD, DISTANCES, share)


def test_a_post_beside_the_road_is_isolated_and_a_post_at_the_kerb_is_not():
    found = isolated([*POSTS, [5.0, 6.0, 1.0]])  # the last may be a vehicle's
    np.testing.assert_allclose(sorted(found.mean[:, 0]), [-8.0, 0.0, 13.0])


def test_what_hangs_overhead_is_isolated_wherever_it_is():
    assert len(isolated([[5.0, 1.0, 4.5]])) == 1


def test_a_ring_on_a_wall_along_the_road_has_no_isolated_points():
    ring = [[x, 14.0, 1.0] for x in np.arange(-10.0, 10.0, 1.2)]
    assert len(isolated(ring)) == 0
    assert len(isolated([*ring, [0.0, 14.0, 3.0]])) == 1  # above it, there is nothing beside


def test_points_of_a_surface_are_no_isolated_points_but_stand_beside_others():
    board = POSTS[1] + [[0.1 * k, 0.0, 0.1 * i] for k in range(2) for i in range(2)]
    assert len(isolated([*board])) == 0
    assert len(isolated([*board, POSTS[1] + [1.5, 0.0, 0.0]])) == 0


def test_where_nothing_is_isolated_nothing_is_met_again():
    none = isolated(np.zeros((0, 3)))
    assert len(none) == len(isolated([[5.0, 1.0, 0.0]])) == 0
    assert not met_again(none, isolated(POSTS)).any()


def test_isolated_points_are_met_again_after_the_distance_travelled():
    count = met_again(isolated(POSTS), isolated(POSTS - [2.5, 0.0, 0.0]))
    assert DISTANCES[count == 3.0] == pytest.approx([2.4, 2.5, 2.6])
    assert not count[np.abs(DISTANCES - 2.5) > 0.25].any()


def test_distances_count_from_the_sensor_however_far_the_poses_say_it_is():
    count = met_again(isolated(POSTS), isolated(POSTS - [2.5, 0.0, 0.0]), travelled=1.7)
    assert DISTANCES[np.argmax(count)] == pytest.approx(2.5, abs=0.11)


def test_what_keeps_its_place_in_the_sensors_frame_says_nothing():
    ring = np.array([[x, 14.0, 1.0] for x in (-9.0, -2.5, 4.0, 12.0)])
    assert not met_again(isolated(ring), isolated(ring)).any()


def test_each_point_is_compensated_for_each_distance():
    """A post met at the end of a sweep, then at its start: it comes nearer by a tenth less at ten sweeps apart."""
    first = isolated(POSTS[1:2], np.full(1, 0.5, np.float32))
    second = isolated(POSTS[1:2] - [2.5, 0.0, 0.0], np.full(1, -0.5, np.float32))
    count = met_again(first, second, share=0.1)
    assert DISTANCES[count > 0.0].mean() == pytest.approx(2.5 / 0.9, abs=0.06)


def test_too_few_points_for_a_surface_are_kept_and_moved_with_the_surfels():
    points = np.array([[10.0, 15.0, 1.0], *([10.0, 0.05 * k, 1.0] for k in range(4))], np.float32)
    surfels = surfels_of(points, np.full(5, 0.5, np.float32))
    assert (len(surfels), len(surfels.sparse)) == (1, 1)
    moved = surfels.compensated(np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(moved.sparse.mean[0], [11.0, 15.0, 1.0], atol=1e-6)
    assert surfels[:1].sparse is None


def test_posts_of_single_points_give_the_speed_where_no_surface_does():
    speed, n = 20.0, 20
    pose = curve(speed, 0.0)
    posts = [
        Block((x, y, 0.6), (0.12, 0.12, 1.2))
        for x, y in zip(np.arange(-40.0, 100.0, 5.3), [15.0, -17.0, 20.0] * 9, strict=True)
    ]
    truth = np.array([pose(0.1 * i) for i in range(n)])
    surfels = [surfels_of(scan.points, None) for scan in record(posts, truth, n_beams=16).sequence]
    standing = Window(surfels, np.zeros((n, 6)), np.tile(np.eye(4), (n, 1, 1)), np.ones(n - 1), 0.1, 0.0)
    np.testing.assert_allclose(search_speed(standing, OdometrySettings()).missing[:, 0], 0.1 * speed, atol=0.05)
    surfaces = replace(standing, surfels=[replace(s, sparse=None) for s in surfels])
    assert not search_speed(surfaces, OdometrySettings()).missing.any()


@pytest.mark.slow
def test_sixteen_beams_follow_a_motorway():
    world = simulate("motorway", "VLP-16", 60, 141)
    found = estimate_trajectory(world, OdometrySettings())
    steps, true_steps = (
        np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) for T in (found.T_world_sensor, world.reference_poses)
    )
    np.testing.assert_allclose(
        steps.reshape(-1)[:57].reshape(3, -1).sum(axis=1), true_steps[:57].reshape(3, -1).sum(axis=1), rtol=0.03
    )
    assert not found.diagnostics["is_speed_doubted"]
