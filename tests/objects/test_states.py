"""The states of a body: the same as the sum over all paths, whatever is known."""

from itertools import product

import numpy as np
import pytest

from automos.objects.states import later, state_probabilities

START, BEGIN, END = 0.3, 0.4, 0.7
TIMES = np.cumsum(np.r_[0.0, np.random.default_rng(0).uniform(0.05, 0.9, 7)])
RATIO = np.random.default_rng(1).normal(0.0, 3.0, 8)


def of_one(ratio, times, start=START, ever=START):
    """p_moving (T,) and p_ever of one body."""
    p_moving, p_ever = state_probabilities(
        np.array([0, len(times)]), times, ratio, np.array([start]), np.array([ever]), BEGIN, END
    )
    return p_moving, p_ever[0]


def over_all_paths(ratio, times):
    """p_moving and p_ever, from the joint density of each of the 2^T paths."""
    dt = np.diff(times)
    still = np.exp(-(BEGIN + END) * dt)
    step = np.empty((len(dt), 2, 2))
    step[:, 0, 1] = BEGIN / (BEGIN + END) * (1.0 - still)
    step[:, 1, 0] = END / (BEGIN + END) * (1.0 - still)
    step[:, 0, 0], step[:, 1, 1] = 1.0 - step[:, 0, 1], 1.0 - step[:, 1, 0]
    moving, total, ever = np.zeros(len(times)), 0.0, 0.0
    for path in product((0, 1), repeat=len(times)):
        p = (1.0 - START, START)[path[0]] * np.exp(ratio @ np.array(path))
        p *= np.prod([step[t, path[t], path[t + 1]] for t in range(len(dt))])
        total += p
        moving += p * np.array(path)
        ever += p * any(path)
    return moving / total, ever / total


@pytest.mark.parametrize("n", range(1, 9))
def test_states_are_the_sum_over_all_paths_of_what_is_known(n):
    moving, ever = over_all_paths(RATIO[:n], TIMES[:n])
    p_moving, p_ever = of_one(RATIO[:n], TIMES[:n])
    np.testing.assert_allclose(p_moving, moving, rtol=1e-9)
    assert p_ever == pytest.approx(ever)


@pytest.mark.parametrize("n", range(1, 8))
def test_two_numbers_stand_for_all_scans_that_are_forgotten(n):
    p_moving, p_ever = of_one(RATIO, TIMES)
    before, ever = of_one(RATIO[:n], TIMES[:n])
    start, ever = later(before[-1:], np.array([ever]), TIMES[n : n + 1] - TIMES[n - 1], BEGIN, END)
    after, ever = of_one(RATIO[n:], TIMES[n:], start[0], ever[0])
    np.testing.assert_allclose(after, p_moving[n:], rtol=1e-9)
    assert ever == pytest.approx(p_ever)


def test_bodies_are_independent_and_one_without_scans_is_what_it_was():
    first, start = np.array([0, 5, 5, 8]), np.array([0.3, 0.6, 0.1])
    p_moving, p_ever = state_probabilities(first, TIMES, RATIO, start, start, BEGIN, END)
    for k, rows in ((0, slice(0, 5)), (2, slice(5, 8))):
        moving, ever = of_one(RATIO[rows], TIMES[rows], start[k], start[k])
        np.testing.assert_array_equal(p_moving[rows], moving)
        assert p_ever[k] == ever
    assert p_ever[1] == 0.6


def test_after_long_enough_nothing_is_known_of_now():
    assert later(np.zeros(1), np.zeros(1), np.full(1, np.inf), BEGIN, END) == (BEGIN / (BEGIN + END),) * 2
    assert later(np.full(1, 0.9), np.full(1, 0.95), np.full(1, 1e3), BEGIN, END)[1] > 0.95


def test_what_waits_and_drives_has_moved_and_stands_while_it_waits():
    ratio, times = np.where(np.arange(100) < 60, -0.4, 0.8), 0.2 * np.arange(100)
    one = np.array([0.3])
    p_moving, p_ever = state_probabilities(np.array([0, 100]), times, ratio, one, one, 0.02, 0.2)
    assert p_moving[:55].max() < 0.1
    assert p_moving[65:].min() > 0.95
    assert p_ever[0] > 0.999


def test_ten_thousand_scans_stay_finite():
    ratio = np.random.default_rng(3).normal(0.0, 30.0, 10_000)
    p_moving, p_ever = of_one(2.0 * ratio, 0.1 * np.arange(10_000))
    for p in (p_moving, p_ever):
        assert np.isfinite(p).all()
        assert ((p >= 0.0) & (p <= 1.0)).all()
