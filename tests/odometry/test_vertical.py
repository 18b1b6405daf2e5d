import numpy as np
import pytest
from raw_worlds import TOWN, curve
from scipy.spatial.transform import Rotation
from worlds import SENSOR_HEIGHT, record

from automos.core.geometry import make_transform
from automos.odometry.vertical import level_frame
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()


def mounted(R_ground_sensor, n=4):
    """Return (clouds, poses T_world_sensor, T_ground_first) of a sensor mounted with that rotation."""
    pose = curve(5.0, 0.1)
    mount = make_transform(R_ground_sensor)
    T_ground_sensor = np.array([pose(0.5 * i) @ mount for i in range(n)])
    level = record(TOWN, np.array([pose(0.5 * i) for i in range(n)]), n_beams=40)
    clouds = [(scan.points @ R_ground_sensor).astype(np.float32) for scan in level.sequence]
    return clouds, np.linalg.inv(T_ground_sensor[0]) @ T_ground_sensor, T_ground_sensor[0]


@pytest.mark.parametrize(
    "turn_deg",
    [(0, 0, 0), (5, 0, 0), (0, -8, 0), (20, 15, 0), (180, 0, 0), (180, 10, 40)],
    ids=["upright", "rolled", "pitched", "tilted", "upside down", "upside down and tilted"],
)
def test_the_ground_is_level_at_zero_however_the_sensor_is_mounted(turn_deg):
    R = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    clouds, poses, T_ground_first = mounted(R)
    T_level_world, found = level_frame(clouds, poses, SETTINGS)
    assert found
    up_in_sensor = T_ground_first[:3, :3].T @ [0.0, 0.0, 1.0]
    assert np.degrees(np.arccos(min(T_level_world[2, :3] @ up_in_sensor, 1.0))) < 0.3
    assert T_level_world[2, 3] == pytest.approx(SENSOR_HEIGHT, abs=0.03)


def test_the_level_frame_keeps_the_heading_of_an_upright_sensor():
    clouds, poses, _ = mounted(np.eye(3))
    T_level_world, _ = level_frame(clouds, poses, SETTINGS)
    np.testing.assert_allclose(T_level_world[:3, :3], np.eye(3), atol=0.01)
    np.testing.assert_allclose(T_level_world[:2, 3], 0.0, atol=1e-6)


def test_without_ground_the_sensors_own_axes_are_kept():
    wall = np.random.default_rng(0).uniform([5, -10, -3], [5.05, 10, 8], (3000, 3)).astype(np.float32)
    T_level_world, found = level_frame([wall], np.eye(4)[None], SETTINGS)
    assert not found
    np.testing.assert_array_equal(T_level_world, np.eye(4))


def test_without_scans_there_is_no_ground():
    T_level_world, found = level_frame([], np.zeros((0, 4, 4)), SETTINGS)
    assert not found
    np.testing.assert_array_equal(T_level_world, np.eye(4))
