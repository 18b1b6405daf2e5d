"""The states of a body: the same as the sum over all paths, whatever is known."""

from itertools import product

import numpy as np
import pytest

from automos.objects.states import state_probabilities

START, BEGIN, END = 0.3, 0.4, 0.7
TIMES = np.cumsum(np.r_[0.0, np.random.default_rng(0).uniform(0.05, 0.9, 7)])
LIKELIHOODS = np.random.default_rng(1).normal(0.0, 2.0, (8, 2))
RATIO = LIKELIHOODS[:, 1] - LIKELIHOODS[:, 0]


def over_all_paths(log_likelihoods, times):
    """p_moving and p_ever, from the joint density of each of the 2^T paths."""
    dt = np.diff(times)
    still = np.exp(-(BEGIN + END) * dt)
    step = np.empty((len(dt), 2, 2))
    step[:, 0, 1] = BEGIN / (BEGIN + END) * (1.0 - still)
    step[:, 1, 0] = END / (BEGIN + END) * (1.0 - still)
    step[:, 0, 0], step[:, 1, 1] = 1.0 - step[:, 0, 1], 1.0 - step[:, 1, 0]
    moving, total, ever = np.zeros(len(times)), 0.0, 0.0
    for path in product((0, 1), repeat=len(times)):
        p = (1.0 - START, START)[path[0]] * np.exp(sum(log_likelihoods[t, s] for t, s in enumerate(path)))
        p *= np.prod([step[t, path[t], path[t + 1]] for t in range(len(dt))])
        total += p
        moving += p * np.array(path)
        ever += p * any(path)
    return moving / total, ever / total


def test_smoothed_states_are_the_sum_over_all_paths():
    moving, ever = over_all_paths(LIKELIHOODS, TIMES)
    p_moving, p_ever = state_probabilities(np.array([0, 8]), TIMES, RATIO, START, BEGIN, END)
    np.testing.assert_allclose(p_moving, moving, rtol=1e-9)
    np.testing.assert_allclose(p_ever, [ever], rtol=1e-9)


def test_bodies_know_nothing_of_each_other():
    first = np.array([0, 3, 3, 8])
    p_moving, p_ever = state_probabilities(first, TIMES, RATIO, START, BEGIN, END)
    for k in (0, 2):
        rows = slice(first[k], first[k + 1])
        moving, ever = over_all_paths(LIKELIHOODS[rows], TIMES[rows])
        np.testing.assert_allclose(p_moving[rows], moving, rtol=1e-9)
        assert p_ever[k] == pytest.approx(ever)
    assert p_ever[1] == 0.0


def test_what_waits_and_drives_has_moved_and_stands_while_it_waits():
    ratio = np.where(np.arange(100) < 60, -0.4, 0.8)
    p_moving, p_ever = state_probabilities(np.array([0, 100]), 0.2 * np.arange(100), ratio, 0.3, 0.02, 0.2)
    assert p_moving[:55].max() < 0.1
    assert p_moving[65:].min() > 0.95
    assert p_ever[0] > 0.999


def test_ten_thousand_scans_stay_finite():
    ratio = np.random.default_rng(3).normal(0.0, 60.0, 10_000)
    for p in state_probabilities(np.array([0, 10_000]), 0.1 * np.arange(10_000), ratio, START, BEGIN, END):
        assert np.isfinite(p).all()
        assert ((p >= 0.0) & (p <= 1.0)).all()
