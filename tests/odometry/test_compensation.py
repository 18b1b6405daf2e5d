import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from automos.core.geometry import se3_exp, transform
from automos.odometry.compensation import compensate


def test_points_move_by_the_part_of_the_motion_that_lies_between_them_and_mid_sweep():
    # The sensor drives 2 m forwards during the sweep: a point seen at its start is 1 m nearer at mid-sweep.
    points = np.array([[10.0, 5.0, 1.0]] * 3, np.float32)
    times = np.array([-0.5, 0.0, 0.5], np.float32)
    moved = compensate(points, times, [2.0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(moved, [[9.0, 5.0, 1.0], [10.0, 5.0, 1.0], [11.0, 5.0, 1.0]], atol=1e-6)


@given(st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6), st.floats(-0.5, 0.5))
def test_every_point_moves_by_the_exponential_of_its_share_of_the_twist(twist, time):
    points = np.array([[3.0, -20.0, 1.0], [0.5, 0.1, -2.0]], np.float32)
    moved = compensate(points, np.full(2, time, np.float32), twist)
    expected = transform(se3_exp(np.float32(time) * np.array(twist)), points.astype(float))
    np.testing.assert_allclose(moved, expected, atol=2e-5)


def test_without_motion_nothing_is_touched():
    points = np.eye(4, 3, dtype=np.float32)
    assert compensate(points, np.zeros(4, np.float32), np.zeros(6)) is points


def test_invalid_points_stay_invalid_and_harm_no_other():
    points = np.array([[np.nan] * 3, [1.0, 0.0, 0.0]], np.float32)
    moved = compensate(points, np.full(2, 0.5, np.float32), [1.0, 0, 0, 0, 0, 0.1])
    assert np.isnan(moved[0]).all()
    assert np.isfinite(moved[1]).all()


def test_a_walls_points_fall_in_one_plane_again():
    # A wall ahead at x = 20 m at mid-sweep; at time s the sensor is at x = 1.5 s, so that it is 20 - 1.5 s away.
    times = np.linspace(-0.5, 0.5, 50).astype(np.float32)
    raw = np.stack([20.0 - 1.5 * times, np.linspace(-5, 5, 50), np.zeros(50)], axis=1).astype(np.float32)
    np.testing.assert_allclose(compensate(raw, times, [1.5, 0, 0, 0, 0, 0])[:, 0], 20.0, atol=1e-5)
