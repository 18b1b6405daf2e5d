"""The states of a body: the same as the sum over all paths, whatever is known."""

from itertools import product

import numpy as np
import pytest

from automos.objects.states import state_probabilities

START, BEGIN, END = 0.3, 0.4, 0.7
TIMES = np.cumsum(np.r_[0.0, np.random.default_rng(0).uniform(0.05, 0.9, 7)])
LIKELIHOODS = np.random.default_rng(1).normal(0.0, 2.0, (8, 2))


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
    p_moving, p_ever = state_probabilities(LIKELIHOODS, TIMES, START, BEGIN, END)
    np.testing.assert_allclose(p_moving, moving, rtol=1e-9)
    np.testing.assert_allclose(p_ever, ever, rtol=1e-9)


@pytest.mark.parametrize("lag", [0.0, 0.5, 1.3, 100.0])
def test_at_a_lag_only_the_scans_up_to_it_count(lag):
    p_moving, p_ever = state_probabilities(LIKELIHOODS, TIMES, START, BEGIN, END, lag)
    for t in range(len(TIMES)):
        n = int((TIMES[t] + lag >= TIMES).sum())
        moving, ever = over_all_paths(LIKELIHOODS[:n], TIMES[:n])
        assert p_moving[t] == pytest.approx(moving[t])
        assert p_ever[t] == pytest.approx(ever)


def test_a_constant_of_a_scan_changes_nothing():
    more = LIKELIHOODS + np.random.default_rng(2).normal(0.0, 50.0, (8, 1))
    np.testing.assert_allclose(
        state_probabilities(more, TIMES, START, BEGIN, END),
        state_probabilities(LIKELIHOODS, TIMES, START, BEGIN, END),
        rtol=1e-9,
    )


def test_what_waits_and_drives_has_moved_and_stands_while_it_waits():
    ratio = np.where(np.arange(100) < 60, -0.4, 0.8)
    p_moving, p_ever = state_probabilities(np.column_stack([0.0 * ratio, ratio]), 0.2 * np.arange(100), 0.3, 0.02, 0.2)
    assert p_moving[:55].max() < 0.1
    assert p_moving[65:].min() > 0.95
    assert p_ever.min() > 0.999


def test_ten_thousand_scans_stay_finite():
    ratio = np.random.default_rng(3).normal(0.0, 30.0, 10_000)
    for lag in (0.0, 2.0, np.inf):
        p_moving, p_ever = state_probabilities(
            np.column_stack([-ratio, ratio]), 0.1 * np.arange(10_000), START, BEGIN, END, lag
        )
        for p in (p_moving, p_ever):
            assert np.isfinite(p).all()
            assert ((p >= 0.0) & (p <= 1.0)).all()
