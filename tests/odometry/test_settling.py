import numpy as np
from raw_worlds import CANYON, curve, true_poses, worst_distance
from worlds import record, van

from automos.odometry.links import Alignment, Links
from automos.odometry.motion import chain
from automos.odometry.settling import settle
from automos.odometry.surfels import surfels_of
from automos.odometry.window import Window
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()


def test_poses_settle_between_searches_for_the_speed():
    pose, n = curve(8.0, 0.0), 30
    traffic = (van(8.0, 0.0, 0.0, 8.0), van(-9.0, 0.2, 0.0, 8.0))
    world = record((*CANYON, *traffic), np.array([pose(0.1 * i) for i in range(n)]), n_beams=32)
    truth = true_poses(pose, n)
    steps = np.linalg.inv(truth[:-1]) @ truth[1:]
    steps[:, :3, 3] *= 0.3  # in step with the traffic
    turn = np.eye(4)  # and turned a little, which hides the true speed from a single search
    turn[:2, :2] = [[np.cos(6e-3), -np.sin(6e-3)], [np.sin(6e-3), np.cos(6e-3)]]
    surfels, poses = [surfels_of(scan.points, None) for scan in world.sequence], chain(np.eye(4), steps @ turn)
    window = Window(surfels, np.zeros((n, 6)), poses, np.ones(n - 1), 0.1, 0.0)
    found = settle(window, 1, Links(Alignment()), SETTINGS, None, has_stamps=True)
    assert worst_distance(found.window.T_world_sensor, truth) < 0.02
