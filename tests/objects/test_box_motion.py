"""Smoothed positions and speeds: exact for what moves evenly, the least squares' answer else."""

import numpy as np
import pytest

from automos.objects.motion import ACCELERATION, NOISE, smooth, smooth_paths

T = np.cumsum(np.r_[0.0, 0.1 + 0.05 * np.random.default_rng(0).random(19)])


def by_least_squares(t, z, variance, jerkiness):
    """The same estimate from one dense linear system over all states."""
    n = len(t)
    A, b = [], []

    def add(row, value, sigma):
        A.append(np.asarray(row) / sigma)
        b.append(value / sigma)

    for i in range(n):
        if not np.isnan(z[i]):
            row = np.zeros(2 * n)
            row[2 * i] = 1.0
            add(row, z[i], np.sqrt(variance[i]))
    for i in range(n - 1):
        dt = t[i + 1] - t[i]
        Q = jerkiness * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        whiten = np.linalg.inv(np.linalg.cholesky(Q))
        F = np.array([[1.0, dt], [0.0, 1.0]])
        rows = np.zeros((2, 2 * n))
        rows[:, 2 * i : 2 * i + 2], rows[:, 2 * i + 2 : 2 * i + 4] = -whiten @ F, whiten
        A.extend(rows)
        b.extend([0.0, 0.0])
    prior = np.zeros((2, 2 * n))
    prior[0, 0] = prior[1, 1] = 0.01  # standard deviation 100
    A.extend(prior)
    b.extend([0.01 * z[0], 0.0])
    A = np.array(A)
    x = np.linalg.lstsq(A, np.array(b), rcond=None)[0]
    return x[::2], x[1::2], np.diag(np.linalg.inv(A.T @ A))[1::2]


@pytest.mark.parametrize("unevenness", [0.0, 0.2])
def test_it_is_the_least_squares_estimate_with_and_without_gaps(unevenness):
    z = 3.0 + 2.0 * T + 0.3 * np.random.default_rng(1).standard_normal(len(T))
    z[5:9] = np.nan
    noise = 0.04 + unevenness * np.arange(len(T))
    for got, expected in zip(smooth(T, z, noise, 2.0), by_least_squares(T, z, noise, 2.0), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-6)


def test_even_motion_is_kept_and_gaps_are_filled_on_the_line():
    z = 1.0 - 4.0 * T
    z[8:14] = z[:2] = np.nan
    x, v, _ = smooth(T, z, np.full(len(T), 0.15**2), ACCELERATION**2)
    np.testing.assert_allclose(x, 1.0 - 4.0 * T, atol=1e-3)
    np.testing.assert_allclose(v, -4.0, atol=1e-2)


def test_a_stop_is_seen_in_time():
    t = 0.1 * np.arange(60)
    z = np.minimum(t, 3.0) * 5.0 + 0.1 * np.random.default_rng(2).standard_normal(60)
    _, v, _ = smooth(t, z, np.full(60, 0.15**2), ACCELERATION**2)
    assert abs(v[:20]).min() > 4.0
    assert abs(v[42:]).max() < 0.7


@pytest.mark.parametrize("n", [1, 2])
def test_short_tracks_have_states(n):
    x, v, _ = smooth(T[:n], np.arange(n, dtype=float), np.full(n, 0.02), 2.0)
    assert np.isfinite(x).all()
    assert np.isfinite(v).all()


def test_paths_are_smoothed_each_by_itself():
    first, times = np.array([0, 5, 8]), np.r_[0.1 * np.arange(5), 0.2 * np.arange(3)]
    measured = np.random.default_rng(3).normal(size=(8, 2))
    measured[2] = np.nan
    noise = NOISE**2 * np.arange(1.0, 17.0).reshape(8, 2)
    position, velocity, variance = smooth_paths(first, times, measured, noise)
    for rows in (slice(0, 5), slice(5, 8)):
        for axis in range(2):
            x, v, of_v = smooth(times[rows], measured[rows, axis].copy(), noise[rows, axis].copy(), ACCELERATION**2)
            np.testing.assert_array_equal(position[rows, axis], x)
            np.testing.assert_array_equal(velocity[rows, axis], v)
            np.testing.assert_array_equal(variance[rows, axis], of_v)
