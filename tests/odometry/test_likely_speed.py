from functools import cache

import numpy as np
import pytest
from raw_worlds import CANYON, curve, true_poses, worst_distance
from worlds import Block, record, van

from automos.odometry.likely_speed import at_likely_speed
from automos.odometry.speed import search_speed, speed_figures
from automos.odometry.surfels import Surfels, surfels_of
from automos.odometry.window import Window
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings(overhead=0.9)
N, SPEED = 30, 8.0

SIGNS = [Block((x, y, 3.6), (0.3, 2.4, 1.8)) for x in np.arange(-30.0, 70.0, 8.0) for y in (7.0, -7.0)]


def surfels_in(blocks, pose) -> list[Surfels]:
    """Return the surfels of each scan of a drive among `blocks`."""
    world = record(blocks, np.array([pose(0.1 * i) for i in range(N)]), n_beams=32)
    return [surfels_of(scan.points, None) for scan in world.sequence]


@cache
def surfels_at(speed) -> list[Surfels]:
    """Return the surfels of each scan of a drive through the canyon."""
    return surfels_in((*CANYON, *SIGNS), curve(speed, 0.0))


def window_of(surfels, poses) -> Window:
    return Window(surfels, np.zeros((len(poses), 6)), poses, np.ones(len(poses) - 1), 0.1, 0.0)


def test_where_nearly_all_that_is_seen_keeps_step_signs_overhead_tell_the_speed():
    lanes = [
        van(x, y, 0.0, SPEED) for y in (3.5, -3.5) for x in np.linspace(-30.0, 30.0, 6) + (2.0 if y > 0.0 else 0.0)
    ]
    ahead_and_behind = [van(9.0, 0.0, 0.0, SPEED), van(-9.0, 0.0, 0.0, SPEED)]
    pose = curve(SPEED, 0.0)
    surfels = surfels_in((*CANYON[:2], *lanes, *ahead_and_behind, *SIGNS), pose)
    window = window_of(surfels, np.tile(np.eye(4), (N, 1, 1)))

    search = search_speed(window, SETTINGS)
    assert not search.missing.any()  # all together, the traffic wins
    assert search.landmarks_at_rival.explains_more_than(search.landmarks)

    found, search = at_likely_speed(window, SETTINGS, None)
    poses = found.T_world_sensor
    assert worst_distance(poses, true_poses(pose, N)) < 0.02 * SPEED * 0.1 * N
    assert not speed_figures([search])["is_speed_doubted"]


@pytest.mark.parametrize("n", [12, N])
@pytest.mark.parametrize("driven", [-1.0, -0.4, 2.5])
def test_whichever_way_poses_went_the_speed_is_found_from_a_standstill(driven, n):
    wrong = true_poses(curve(driven * SPEED, 0.0), N)
    found, search = at_likely_speed(window_of(surfels_at(SPEED), wrong).part(0, n), SETTINGS, None)
    assert worst_distance(found.T_world_sensor, true_poses(curve(SPEED, 0.0), n)) < 0.02 * SPEED * 0.1 * n
    assert search.is_clear


def test_who_is_right_is_not_moved_and_no_standstill_is_tried(monkeypatch):
    monkeypatch.setattr("automos.odometry.likely_speed.rivals_from_rest", lambda *still: pytest.fail("it is clear"))
    window = window_of(surfels_at(SPEED), true_poses(curve(SPEED, 0.0), N))
    found, search = at_likely_speed(window, SETTINGS, None)
    assert found is window
    assert search.is_clear


def test_who_creeps_is_not_held_to_drive_as_a_passing_van():
    wrong = true_poses(curve(-4.0, 0.0), N)
    found, _ = at_likely_speed(window_of(surfels_at(1.0), wrong), SETTINGS, None)
    assert worst_distance(found.T_world_sensor, true_poses(curve(1.0, 0.0), N)) < 0.1
