import numpy as np
import pytest

from automos.core.geometry import make_transform, se3_exp, se3_log
from automos.core.scan import Scan
from automos.odometry.motion import can_be_driven, greatest_acceleration, step_twists, timed_points
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings


def test_twists_are_the_mean_of_the_steps_on_both_sides_per_usual_gap():
    one, two = np.array([1.0, 0, 0, 0, 0, 0.1]), np.array([4.0, 0, 0, 0, 0, 0.1])
    poses = np.array([np.eye(4), se3_exp(one), se3_exp(one) @ se3_exp(two)])
    twists = step_twists(poses, np.array([1.0, 2.0]))  # a scan is missing before the last
    np.testing.assert_allclose(twists[0], one, atol=1e-12)
    np.testing.assert_allclose(twists[1], 0.5 * (one + two / 2.0), atol=1e-12)
    np.testing.assert_allclose(twists[2], two / 2.0, atol=1e-12)


def test_a_single_scan_does_not_move():
    np.testing.assert_array_equal(step_twists(np.eye(4)[None], np.zeros(0)), np.zeros((1, 6)))


def test_step_twists_agree_with_the_logarithm_of_a_constant_motion():
    twist = np.array([1.2, 0.1, -0.05, 0.01, 0.02, 0.08])
    poses = np.array([se3_exp(k * twist) for k in range(5)])
    np.testing.assert_allclose(step_twists(poses, np.ones(4)), np.tile(twist, (5, 1)), atol=1e-9)
    np.testing.assert_allclose(se3_log(np.linalg.inv(poses[1]) @ poses[2]), twist, atol=1e-9)


def driven(speeds, dt=0.1):
    """Poses of a straight drive at `speeds` (N,) m/s, and their times."""
    T = np.tile(np.eye(4), (len(speeds), 1, 1))
    T[1:, 0, 3] = np.cumsum(dt * 0.5 * (np.array(speeds[1:]) + speeds[:-1]))
    return T, dt * np.arange(len(speeds))


def test_the_greatest_acceleration_is_that_of_the_hardest_half_second():
    braking = [20.0] * 20 + [20.0 - 0.7 * k for k in range(1, 21)] + [6.0] * 20
    found, at = greatest_acceleration(*driven(braking))
    assert found == pytest.approx(7.0, abs=0.1)
    assert 20 <= at <= 40
    assert can_be_driven(*driven(braking))


def test_one_step_that_is_off_is_noise_and_a_speed_that_leaps_is_not():
    T, times = driven([10.0] * 60)
    T[30:, 0, 3] += 0.2
    assert can_be_driven(T, times)
    assert not can_be_driven(*driven([0.0] * 30 + [10.0] * 30))


@pytest.mark.parametrize("n", [0, 1, 2, 5])
def test_too_few_scans_tell_no_acceleration(n):
    assert greatest_acceleration(*driven([0.0, 30.0, 0.0, 30.0, 0.0][:n]))[0] == 0.0


def test_missing_returns_of_every_lidar_are_left_out():
    mounts = np.stack([np.eye(4), make_transform(t=[3.0, 0.0, 0.0])])
    points = np.array([[0, 0, 0], [9, 0, 0], [3, 0, 0], [9, 1, 0]], np.float32)  # a missing return of each first
    scan = Scan(points, sensor=np.array([0, 0, 1, 1], np.uint8), T_scan_sensor=mounts)
    kept, times = timed_points(scan, SweepTiming(), OdometrySettings())
    np.testing.assert_array_equal(kept, points[[1, 3]])
    assert times is None
