"""The filters against Kalman filters of one and two numbers, written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automos.core.upright_boxes import Boxes
from automos.objects import filter as kalman
from automos.settings import load_settings

SETTINGS = load_settings("paper").tracking.filter
P0, PV0 = SETTINGS.initial_variance, SETTINGS.initial_velocity_variance
Q, QV, R = SETTINGS.process_variance, SETTINGS.process_velocity_variance, SETTINGS.measurement_variance


def boxes(rows) -> Boxes:
    """Return boxes from rows of x, y, z, yaw, length, width, height."""
    rows = np.atleast_2d(np.asarray(rows, float))
    return Boxes(rows[:, :3], rows[:, 4:], rows[:, 3], np.ones(len(rows)))


def begin(measured: Boxes) -> kalman.Beliefs:
    return kalman.start(measured, SETTINGS, PV0)


def follow_number(values, steps):
    """Return mean and variance of a number that wanders (variance Q a second) after measuring `values`."""
    mean, P = values[0], P0
    for value, dt in zip(values[1:], steps, strict=True):
        P = P + Q * dt
        gain = P / (P + R)
        mean, P = mean + gain * (value - mean), (1.0 - gain) * P
    return mean, P


def follow_place(values, steps):
    """Return mean (2,) and covariance (2, 2) of a place and its velocity after measuring the place."""
    mean, P = np.array([values[0], 0.0]), np.diag([P0, PV0])
    for value, dt in zip(values[1:], steps, strict=True):
        F = np.array([[1.0, dt], [0.0, 1.0]])
        mean, P = F @ mean, F @ P @ F.T + np.diag([Q, QV]) * dt
        gain = P[:, 0] / (P[0, 0] + R)
        mean, P = mean + gain * (value - mean[0]), P - np.outer(gain, P[0])
    return mean, P


@given(
    st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 3, st.floats(-0.3, 0.3), *[st.floats(0.5, 5.0)] * 3), min_size=1),
    st.data(),
)
def test_every_number_is_followed_as_by_a_filter_of_its_own(rows, data):
    steps = data.draw(st.lists(st.sampled_from([0.05, 0.1, 0.3]), min_size=len(rows) - 1, max_size=len(rows) - 1))
    beliefs = begin(boxes(rows[0]))
    for row, dt in zip(rows[1:], steps, strict=True):
        beliefs = kalman.update(kalman.predict(beliefs, dt, SETTINGS), boxes(row), SETTINGS)
    mean, covariance = beliefs.mean[0], beliefs.covariance[0]
    rows = np.array(rows)
    for axis in range(3):
        # variances of up to 1e6 leave 1e-9 of rounding
        expected, P = follow_place(rows[:, axis], steps)
        np.testing.assert_allclose(mean[[axis, 7 + axis]], expected, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(covariance[np.ix_([axis, 7 + axis], [axis, 7 + axis])], P, rtol=1e-6, atol=1e-6)
    for number in range(3, 7):
        expected, variance = follow_number(rows[:, number], steps)
        assert mean[number] == pytest.approx(expected, abs=1e-9)
        assert covariance[number, number] == pytest.approx(variance, rel=1e-9)


def test_after_two_sights_the_velocity_is_the_step_over_the_time():
    beliefs = begin(boxes([0, 0, 0, 0, 4, 2, 1.5]))
    np.testing.assert_array_equal(beliefs.mean[0, 7:], 0.0)
    beliefs = kalman.predict(beliefs, 0.1, SETTINGS)
    # by hand: the place's variance is 10 + 1e6 * 0.01 + 1 = 10011, the gain of velocity 1e5 / 10012 = 9.988
    np.testing.assert_allclose(np.diag(beliefs.covariance[0])[:3], 10011.0)
    beliefs = kalman.update(beliefs, boxes([1.0, 0, -0.5, 0, 4, 2, 1.5]), SETTINGS)
    np.testing.assert_allclose(beliefs.mean[0, 7:], [9.988, 0.0, -4.994], atol=1e-3)


def test_a_prediction_moves_with_the_velocity_and_changes_nothing_else():
    mean = np.array([[1.0, 2.0, 3.0, 0.5, 4.0, 2.0, 1.5, 10.0, -5.0, 1.0]])
    beliefs = kalman.predict(kalman.Beliefs(mean, np.eye(10)[None]), 0.2, SETTINGS)
    np.testing.assert_allclose(beliefs.mean, [[3.0, 1.0, 3.2, 0.5, 4.0, 2.0, 1.5, 10.0, -5.0, 1.0]])


def test_no_time_changes_nothing():
    beliefs = begin(boxes([1, 2, 3, 0.5, 4, 2, 1.5]))
    later = kalman.predict(beliefs, 0.0, SETTINGS)
    np.testing.assert_array_equal(later.mean, beliefs.mean)
    np.testing.assert_array_equal(later.covariance, beliefs.covariance)


def test_noise_is_per_second_so_that_many_short_steps_are_as_uncertain_as_a_long_one():
    long = short = begin(boxes([0, 0, 0, 0, 4, 2, 1.5]))
    long = kalman.predict(long, 0.4, SETTINGS)
    for _ in range(4):
        short = kalman.predict(short, 0.1, SETTINGS)
    np.testing.assert_allclose(
        np.diag(short.covariance[0])[kalman.YAW :], np.diag(long.covariance[0])[kalman.YAW :], rtol=1e-12
    )


# ------------------------------------------------------------------------------------------- headings on a circle
@pytest.mark.parametrize(
    ("measured_deg", "expected_deg", "written_deg", "is_swapped"),
    [
        (10, 0, 10, False),
        (170, 0, -10, False),
        (-170, 0, 10, False),
        (100, 0, 10, True),
        (-80, 0, 10, True),
        (44, 0, 44, False),
        (46, 0, -44, True),
        (-179, 179, 181, False),
        (1, 179, 181, False),
        (-89, 179, 181, True),
        (30, 750, 750, False),
    ],
)
def test_a_box_is_written_as_the_same_box_of_the_nearest_heading(measured_deg, expected_deg, written_deg, is_swapped):
    measured = np.array([[1.0, 2.0, 3.0, np.radians(measured_deg), 4.0, 2.0, 1.5]])
    written = kalman.same_box_nearest(measured, np.radians([expected_deg]))
    size = [2.0, 4.0, 1.5] if is_swapped else [4.0, 2.0, 1.5]
    np.testing.assert_allclose(written, [[1.0, 2.0, 3.0, np.radians(written_deg), *size]], atol=1e-12)
    assert measured[0, 4] == 4.0  # the caller's array is left alone


@given(st.floats(-7.0, 7.0), st.floats(-7.0, 7.0))
def test_the_nearest_heading_is_within_an_eighth_of_a_turn_and_keeps_the_corners(measured_yaw, yaw):
    measured = np.array([[1.0, 2.0, 3.0, measured_yaw, 4.0, 2.0, 1.5]])
    written = kalman.same_box_nearest(measured, np.array([yaw]))
    assert abs(written[0, 3] - yaw) <= np.pi / 4 + 1e-9
    before, after = boxes(measured).corners()[0], boxes(written).corners()[0]
    for corner in before:
        assert np.linalg.norm(after - corner, axis=1).min() < 1e-9


@pytest.mark.parametrize("quarters", range(-4, 5))
def test_a_heading_given_any_quarters_of_a_turn_away_updates_the_same(quarters):
    prior = kalman.predict(begin(boxes([0, 0, 0, 3.0, 4, 2, 1.5])), 0.1, SETTINGS)
    size = [4.2, 1.9, 1.5] if quarters % 2 == 0 else [1.9, 4.2, 1.5]
    turned = kalman.update(prior, boxes([0.5, 0, 0, 3.1 + quarters * np.pi / 2, *size]), SETTINGS)
    straight = kalman.update(prior, boxes([0.5, 0, 0, 3.1, 4.2, 1.9, 1.5]), SETTINGS)
    np.testing.assert_allclose(turned.mean, straight.mean, atol=1e-9)


def test_a_heading_passes_half_a_turn_without_a_jump():
    beliefs = begin(boxes([0, 0, 0, np.radians(170), 4, 2, 1.5]))
    for deg in (174, 178, -178, -174):
        beliefs = kalman.update(
            kalman.predict(beliefs, 0.1, SETTINGS), boxes([0, 0, 0, np.radians(deg), 4, 2, 1.5]), SETTINGS
        )
        assert abs(beliefs.mean[0, kalman.YAW]) <= np.pi
    # it lags behind by a few degrees, on the far side of half a turn
    assert -180 <= np.degrees(beliefs.mean[0, kalman.YAW]) <= -172
    np.testing.assert_allclose(beliefs.mean[0, kalman.SIZE], [4, 2, 1.5], atol=1e-9)


# --------------------------------------------------------------------------------------------------------- health
def test_covariances_stay_symmetric_and_positive_through_thousands_of_updates():
    rng = np.random.default_rng(0)
    beliefs = begin(boxes(np.tile([0, 0, 0, 0, 4, 2, 1.5], (3, 1))))
    for _ in range(3000):
        beliefs = kalman.predict(beliefs, 0.1, SETTINGS)
        beliefs = kalman.update(beliefs, boxes(rng.normal([0, 0, 0, 0, 4, 2, 1.5], 0.1, (3, 7))), SETTINGS)
    np.testing.assert_allclose(beliefs.covariance, np.swapaxes(beliefs.covariance, 1, 2), atol=1e-12)
    assert np.linalg.eigvalsh(beliefs.covariance).min() > 0.0


def test_rows_do_not_know_each_other():
    rows = np.random.default_rng(0).normal([0, 0, 0, 0, 4, 2, 1.5], 0.3, (2, 4, 7))
    both = kalman.update(kalman.predict(begin(boxes(rows[0])), 0.1, SETTINGS), boxes(rows[1]), SETTINGS)
    for k in range(4):
        one = begin(boxes(rows[0, k]))
        one = kalman.update(kalman.predict(one, 0.1, SETTINGS), boxes(rows[1, k]), SETTINGS)
        np.testing.assert_allclose(both.mean[k], one.mean[0], rtol=1e-12)
        np.testing.assert_allclose(both.covariance[k], one.covariance[0], rtol=1e-12)


def test_no_boxes_are_no_beliefs():
    none = begin(Boxes.empty())
    none = kalman.update(kalman.predict(none, 0.1, SETTINGS), Boxes.empty(), SETTINGS)
    assert len(none) == len(none.boxes()) == 0


def test_a_box_never_shrinks_to_nothing():
    beliefs = begin(boxes([0, 0, 0, 0, 1, 0, 0]))
    assert (beliefs.boxes().size > 0.0).all()
