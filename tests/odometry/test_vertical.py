import numpy as np
import pytest
from raw_worlds import TOWN, curve
from scipy.spatial.transform import Rotation
from worlds import SENSOR_HEIGHT, record

from automos.core.geometry import make_transform
from automos.odometry.surfels import surfels_of
from automos.odometry.vertical import level_frame
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()


def level_of(clouds, poses):
    surfels = [surfels_of(cloud, None) for cloud in clouds]
    return level_frame([(of_scan.mean, of_scan.covariance) for of_scan in surfels], poses, SETTINGS)


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
    T_level_world, found, _ = level_of(clouds, poses)
    assert found
    up_in_sensor = T_ground_first[:3, :3].T @ [0.0, 0.0, 1.0]
    assert np.degrees(np.arccos(min(T_level_world[2, :3] @ up_in_sensor, 1.0))) < 0.3
    assert T_level_world[2, 3] == pytest.approx(SENSOR_HEIGHT, abs=0.03)


def test_the_level_frame_keeps_the_heading_of_an_upright_sensor():
    clouds, poses, _ = mounted(np.eye(3))
    T_level_world, _, _ = level_of(clouds, poses)
    np.testing.assert_allclose(T_level_world[:3, :3], np.eye(3), atol=0.01)
    np.testing.assert_allclose(T_level_world[:2, 3], 0.0, atol=1e-6)


def test_without_ground_the_sensors_own_axes_are_kept():
    wall = np.random.default_rng(0).uniform([5, -10, -3], [5.05, 10, 8], (3000, 3)).astype(np.float32)
    T_level_world, found, _ = level_of([wall], np.eye(4)[None])
    assert not found
    np.testing.assert_array_equal(T_level_world, np.eye(4))


def test_without_scans_there_is_no_ground():
    T_level_world, found, _ = level_of([], np.zeros((0, 4, 4)))
    assert not found
    np.testing.assert_array_equal(T_level_world, np.eye(4))


def plane(height, half=8.0, spacing=0.1):
    """Points of a level square around the sensor, but not right below or above it, which few beams reach."""
    x, y = (grid.ravel() for grid in np.meshgrid(*2 * [np.arange(-half, half, spacing)]))
    far = np.hypot(x, y) > 2.0
    return np.stack([x[far], y[far], np.full(far.sum(), height)], axis=1)


def box(x, y, low, high, half=0.5, spacing=0.1):
    """Points of the sides of an upright box."""
    u, z = (grid.ravel() for grid in np.meshgrid(np.arange(-half, half, spacing), np.arange(low, high, spacing)))
    sides = [np.stack([side * half + 0.0 * u, u, z], axis=1) for side in (-1, 1)]
    around = np.concatenate([*sides, *(of[:, [1, 0, 2]] for of in sides)])
    return around + np.array([x, y, 0.0])


def hall(n_desks):
    """A floor and a ceiling equally far away, walls from one to the other, and desks on the floor."""
    places = [(4.0 * np.cos(a), 4.0 * np.sin(a)) for a in np.linspace(0.0, 6.0, n_desks)]
    walls = box(0.0, 0.0, -1.5, 1.5, half=8.0)
    return np.concatenate([plane(-1.5), plane(1.5), walls, *(box(x, y, -1.5, -0.6) for x, y in places)])


def up_in_sensor(cloud, turn_deg):
    R = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    level = level_of([(cloud @ R).astype(np.float32)], np.eye(4)[None])
    return R @ level.T_level_world[2, :3], level


@pytest.mark.parametrize("turn_deg", [(0, 0, 0), (20, 0, 0), (0, -15, 50)])
def test_of_a_floor_and_a_ceiling_an_upright_sensor_stands_over_the_floor(turn_deg):
    up, level = up_in_sensor(hall(n_desks=0), turn_deg)
    np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=0.01)
    assert level.has_ground


def test_where_only_the_prior_decides_the_vertical_is_doubtful():
    assert not up_in_sensor(hall(n_desks=8), (0, 0, 0))[1].is_doubtful
    assert up_in_sensor(hall(n_desks=8), (180, 0, 0))[1].is_doubtful


def test_what_stands_on_it_tells_the_floor_from_the_ceiling_of_a_sensor_that_hangs():
    empty = np.concatenate([plane(-1.5), plane(1.5, half=6.0)])
    desks = [box(x, y, -1.4, -0.6) for x in np.arange(-6.0, 7.0, 2.0) for y in (-6, -4, 4, 6)]
    np.testing.assert_allclose(up_in_sensor(empty, (180, 0, 0))[0], [0.0, 0.0, -1.0], atol=0.02)
    np.testing.assert_allclose(
        up_in_sensor(np.concatenate([empty, *desks]), (180, 0, 0))[0], [0.0, 0.0, 1.0], atol=0.02
    )


def test_walls_that_pass_through_a_plane_are_no_ground():
    room = box(0.5, 0.5, -0.7, 0.9, half=3.0)
    _, level = up_in_sensor(np.concatenate([room, box(1.5, -1.0, -0.4, 0.4)]), (0, 0, 0))
    assert not level.has_ground
