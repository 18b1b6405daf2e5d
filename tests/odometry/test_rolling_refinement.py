import numpy as np
import pytest
from raw_worlds import CANYON, TOWN, curve, true_poses, worst_distance
from test_refine import shaken
from worlds import record, van

from automos.odometry import refine
from automos.odometry.clock import Clock
from automos.odometry.motion import chain
from automos.odometry.refine import RollingRefinement
from automos.odometry.surfels import surfels_of
from automos.settings import OdometrySettings

N = 45
SETTINGS = OdometrySettings()
CLOCK = Clock(0.1 * np.arange(N), 0.1, np.ones(N - 1), has_stamps=True)


@pytest.fixture
def short_windows(monkeypatch):
    monkeypatch.setattr(refine, "WINDOW", 2.0)
    monkeypatch.setattr(refine, "OVERLAP", 1.0)


@pytest.fixture(scope="module")
def drive():
    pose = curve(5.0, 0.1)
    world = record(TOWN, np.array([pose(0.1 * i) for i in range(N)]))
    return [surfels_of(scan.points, None) for scan in world.sequence], true_poses(pose, N)


def roll(surfels, poses):
    refinement = RollingRefinement(CLOCK, 0.0, SETTINGS)
    for i in range(len(poses)):
        step = np.linalg.inv(poses[max(i - 1, 0)]) @ poses[i]
        refinement.add(surfels[i], np.zeros(6), step, 1.0)
    return refinement


@pytest.mark.usefixtures("short_windows")
def test_windows_refine_as_well_as_the_whole(drive):
    surfels, truth = drive
    start = shaken(truth)
    poses, _ = roll(surfels, start).finish()
    assert len(poses) == N
    assert worst_distance(start, truth) > 0.2
    assert worst_distance(poses, truth) < 0.03


@pytest.mark.usefixtures("short_windows")
def test_no_step_jumps_where_windows_meet(drive):
    surfels, truth = drive
    poses, _ = roll(surfels, shaken(truth)).finish()
    steps, true_steps = (np.linalg.norm(np.diff(p[:, :3, 3], axis=0), axis=1) for p in (poses, truth))
    np.testing.assert_allclose(steps, true_steps, atol=0.015)


@pytest.mark.usefixtures("short_windows")
def test_no_more_than_a_window_of_scans_is_kept(drive):
    surfels, truth = drive
    refinement = roll(surfels, truth)
    assert len(refinement._poses) <= 20


def test_poses_settle_between_searches_for_the_speed():
    pose, n = curve(8.0, 0.0), 30
    traffic = (van(8.0, 0.0, 0.0, 8.0), van(-9.0, 0.2, 0.0, 8.0))
    world = record((*CANYON, *traffic), np.array([pose(0.1 * i) for i in range(n)]), n_beams=32)
    truth = true_poses(pose, n)
    steps = np.linalg.inv(truth[:-1]) @ truth[1:]
    steps[:, :3, 3] *= 0.3  # in step with the traffic
    turn = np.eye(4)  # and turned a little, which hides the true speed from a single search
    turn[:2, :2] = [[np.cos(6e-3), -np.sin(6e-3)], [np.sin(6e-3), np.cos(6e-3)]]
    surfels = [surfels_of(scan.points, None) for scan in world.sequence]
    poses, _ = roll(surfels, chain(np.eye(4), steps @ turn)).finish()
    assert worst_distance(poses, truth) < 0.02
