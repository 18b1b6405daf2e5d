from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from raw_worlds import TOWN, true_poses, worst_distance
from raw_worlds import curve as curve_of
from worlds import record, van

from automos.core.geometry import se3_exp
from automos.odometry.links import Alignment, Links, consistency_of
from automos.odometry.motion import chain
from automos.odometry.refine import refine_poses
from automos.odometry.surfels import surfels_of
from automos.odometry.window import Window
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()
N = 30


def window_at(surfels, poses) -> Window:
    return Window(surfels, np.zeros((len(poses), 6)), poses, np.ones(len(poses) - 1), 0.1, 0.0)


def shaken(poses, metres=0.03, degrees=0.1):
    """Return the poses with noise added to every step."""
    rng = np.random.default_rng(0)
    noise = np.concatenate(
        [rng.normal(0, metres, (len(poses) - 1, 3)), rng.normal(0, np.radians(degrees), (len(poses) - 1, 3))], axis=1
    )
    return chain(poses[0], np.linalg.inv(poses[:-1]) @ poses[1:] @ se3_exp(noise))


@pytest.fixture(scope="module")
def town():
    """Return (surfels, true poses) of a drive through a town, a van keeping pace beside the sensor."""
    pose = curve_of(6.0, 0.1)
    world = record((*TOWN, van(2.0, 3.0, 0.0, speed=6.0)), np.array([pose(0.1 * i) for i in range(N)]))
    return [surfels_of(scan.points, None) for scan in world.sequence], true_poses(pose, N)


def test_shaken_poses_come_back_to_within_two_centimetres(town):
    surfels, truth = town
    start = shaken(truth)
    assert worst_distance(start, truth) > 0.15
    window, about = window_at(surfels, start), Alignment()
    refined, after = refine_poses(window, SETTINGS, Links(about))
    links = Links(about)
    chosen = links.choose(window)
    before = consistency_of(window, chosen, links.fit(window, chosen, about.kernels[0]))
    assert worst_distance(refined.T_world_sensor, truth) < 0.02
    assert np.median(after.disagreement) < 0.2 * np.median(before.disagreement)
    assert np.median(after.thickness) < np.median(before.thickness)


def test_right_poses_stay(town):
    surfels, truth = town
    refined, _ = refine_poses(window_at(surfels, truth), SETTINGS, Links(Alignment()))
    assert worst_distance(refined.T_world_sensor, truth) < 0.02


def test_fixed_scans_stay_to_the_micrometre_while_others_move(town):
    surfels, truth = town
    start = shaken(truth)
    refined, _ = refine_poses(window_at(surfels, start), SETTINGS, Links(Alignment()), n_fixed=10)
    moved = np.linalg.norm(refined.T_world_sensor[:, :3, 3] - start[:, :3, 3], axis=1)
    assert moved[:10].max() < 1e-6
    assert moved[10:].max() > 0.01


def test_the_result_does_not_depend_on_the_threads(town):
    surfels, truth = town
    alone, _ = refine_poses(window_at(surfels, shaken(truth)), SETTINGS, Links(Alignment()))
    with ThreadPoolExecutor(3) as pool:
        shared, _ = refine_poses(window_at(surfels, shaken(truth)), SETTINGS, Links(Alignment(), pool))
    np.testing.assert_array_equal(alone.T_world_sensor, shared.T_world_sensor)


def test_scans_without_points_are_bridged_by_even_motion(town):
    surfels, truth = town
    nothing = surfels[0][:0]
    holed = [nothing if i in (12, 13, 14) else s for i, s in enumerate(surfels)]
    refined, _ = refine_poses(window_at(holed, shaken(truth)), SETTINGS, Links(Alignment()))
    assert worst_distance(refined.T_world_sensor, truth) < 0.04


def test_where_nothing_is_seen_poses_stay(town):
    surfels, truth = town
    refined, found = refine_poses(window_at([surfels[0][:0]] * 4, truth[:4]), SETTINGS, Links(Alignment()))
    assert len(found.lag) == 0
    assert worst_distance(refined.T_world_sensor, truth[:4]) < 0.02


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_shortest_recordings_are_refined_too(town, n):
    surfels, truth = town
    refined, _ = refine_poses(window_at(surfels[:n], truth[:n]), SETTINGS, Links(Alignment()))
    assert worst_distance(refined.T_world_sensor, truth[:n]) < 0.03
