import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automos.geometry import se3_exp, se3_log, transform
from automos.odometry.motion import (
    SweepTiming,
    azimuth_times,
    can_be_driven,
    compensate,
    greatest_acceleration,
    recorded_duration,
    step_twists,
    sweep_times,
)
from automos.scan import Scan

AROUND = np.array([[1, 0, 0], [0, 1, 0], [-1, 1e-4, 0], [0, -1, 0]], np.float32)  # 0, 90, 180, 270 degrees


@pytest.mark.parametrize(
    ("turn", "seam_deg", "expected"),
    [
        (1, 180.0, [0.0, 0.25, 0.5, -0.25]),
        (-1, 180.0, [0.0, -0.25, -0.5, 0.25]),
        (1, 0.0, [-0.5, -0.25, 0.0, 0.25]),
        (-1, 90.0, [-0.25, -0.5, 0.25, 0.0]),
    ],
    ids=["counter-clockwise from the back", "clockwise from the back", "from the front", "from the left"],
)
def test_the_azimuth_tells_when_in_the_sweep_a_point_was_measured(turn, seam_deg, expected):
    times = azimuth_times(AROUND, turn, seam_deg)
    off = np.abs(times - expected)
    np.testing.assert_allclose(np.minimum(off, 1.0 - off), 0.0, atol=1e-4)  # either end of the sweep at the seam


def test_times_from_the_file_are_fractions_of_the_usual_sweep_and_never_outside_it():
    scan = Scan(np.ones((4, 3), np.float32), time=np.array([0.0, 0.05, 0.1, 0.13], np.float32))
    times = sweep_times(scan, SweepTiming("file", duration=0.1, share=1.0))
    np.testing.assert_allclose(times, [-0.5, 0.0, 0.5, 0.5], atol=1e-6)


@pytest.mark.parametrize(
    ("times", "duration"),
    [([0.0, 0.05, 0.1], 0.1), ([np.nan, 0.1, np.inf], 0.1), ([np.inf] * 3, None), ([0.0, 1e30, -np.inf], None)],
)
def test_times_that_are_no_times_within_a_sweep_tell_not_how_long_it_took(times, duration):
    found = recorded_duration(Scan(np.ones((3, 3), np.float32), time=np.array(times, np.float32)))
    assert found == (None if duration is None else pytest.approx(duration))


def test_a_compensated_sweep_has_no_times():
    assert sweep_times(Scan(AROUND, time=np.zeros(4, np.float32)), SweepTiming()) is None


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
    assert compensate(AROUND, np.zeros(4, np.float32), np.zeros(6)) is AROUND


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
