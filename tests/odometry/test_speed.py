import numpy as np
import pytest
from raw_worlds import CANYON, curve, true_poses, worst_distance
from worlds import record, van

from automos.odometry.refine import refine_poses
from automos.odometry.speed import lengthen, missing_distance
from automos.odometry.stretch import Stretch
from automos.odometry.sweeps import surfels_of
from automos.settings import RefineSettings

SETTINGS = RefineSettings()
N, SPEED = 30, 8.0

TRAFFIC = (van(8.0, 0.0, 0.0, SPEED), van(-9.0, 0.2, 0.0, SPEED), van(2.0, 3.5, 0.0, SPEED), van(-5.0, 3.5, 0.0, SPEED))


def stretch_of(world, poses) -> Stretch:
    surfels = [surfels_of(scan.points, None, SETTINGS) for scan in world.sequence]
    return Stretch(surfels, np.zeros((len(poses), 6)), poses, np.ones(len(poses) - 1), 0.1, 0.0)


def shortened(poses, ratio):
    """Return the poses with all steps `ratio` as long, as traffic at the sensor's own speed makes them."""
    steps = np.linalg.inv(poses[:-1]) @ poses[1:]
    return lengthen(poses, (ratio - 1.0) * steps[:, :3, 3])


@pytest.fixture(scope="module")
def canyon():
    pose = curve(SPEED, 0.0)
    world = record((*CANYON, *TRAFFIC), np.array([pose(0.1 * i) for i in range(N)]), n_beams=32)
    return world, true_poses(pose, N)


@pytest.mark.parametrize("ratio", [0.9, 0.6, 0.3])
def test_steps_too_short_are_found_by_what_faces_along_the_street(canyon, ratio):
    world, truth = canyon
    stretch = stretch_of(world, shortened(truth, ratio))
    missing = missing_distance(stretch, SETTINGS)
    np.testing.assert_allclose(missing[:, 0], (1.0 - ratio) * 0.1 * SPEED, atol=0.04)
    np.testing.assert_allclose(missing[:, 1:], 0.0, atol=0.01)
    refined, _, _ = refine_poses(stretch.moved(lengthen(stretch.T_world_sensor, missing)), np.zeros(N, bool), SETTINGS)
    assert worst_distance(refined.T_world_sensor, truth) < 0.005 * SPEED * 0.1 * N  # half a per cent


def test_without_it_refinement_keeps_step_with_the_traffic(canyon):
    world, truth = canyon
    stretch = stretch_of(world, shortened(truth, 0.3))
    refined, _, _ = refine_poses(stretch, np.zeros(N, bool), SETTINGS)
    assert worst_distance(refined.T_world_sensor, truth) > 5.0


def test_right_steps_stay(canyon):
    world, truth = canyon
    assert not missing_distance(stretch_of(world, truth), SETTINGS).any()


def test_a_vehicle_that_stands_is_not_driven_by_those_who_pass():
    passing = (
        van(-20.0, 3.5, 0.0, 9.0),
        van(-10.0, 3.5, 0.0, 9.0),
        van(0.0, 3.5, 0.0, 9.0),
        van(25.0, -3.5, np.pi, 9.0),
    )
    pose = curve(0.0, 0.0)
    world = record((*CANYON, *passing), np.array([pose(0.1 * i) for i in range(N)]))
    assert not missing_distance(stretch_of(world, true_poses(pose, N)), SETTINGS).any()


def test_one_scan_misses_nothing(canyon):
    world, truth = canyon
    surfels = [surfels_of(world.sequence[0].points, None, SETTINGS)]
    stretch = Stretch(surfels, np.zeros((1, 6)), truth[:1], np.ones(0), 0.1, 0.0)
    assert missing_distance(stretch, SETTINGS).shape == (0, 3)
