from pathlib import Path

import numpy as np
import pytest

from automos.readers.columns import to_scan
from automos.readers.point_times import judge_times, sweep_bounds

WHERE = Path("log")
SWEEP = np.linspace(0.0, 0.1, 200)


def scan(times, **more):
    return {axis: np.ones(len(times), np.float32) for axis in "xyz"} | {"t": times} | more


def test_times_after_the_first_point_are_not_absolute():
    times = judge_times([scan(SWEEP), scan(SWEEP + 0.002), scan(SWEEP)], WHERE)
    assert (times.unit, times.is_absolute, times.warnings) == (1.0, False, ())


@pytest.mark.parametrize("origin", [1.6e9, 4000.0])
def test_times_on_one_clock_are(origin):
    times = judge_times([scan(origin + k + SWEEP) for k in (0.0, 0.1, 3.0)], WHERE)
    assert times.is_absolute


@pytest.mark.parametrize("span", [5.0e-4, 1.9])
def test_times_that_last_far_longer_or_shorter_than_the_gap_are_of_no_known_unit(span):
    times = judge_times([scan(10.0 * span * SWEEP)], WHERE, gap=0.1)
    assert times.unit is None
    assert "a scan comes every 0.1 s" in times.warnings[0]


def test_points_shuffled_in_the_file_do_not_run_backwards():
    shuffled = np.random.default_rng(0).permutation(SWEEP)
    assert judge_times([scan(shuffled)], WHERE).warnings == ()


def test_two_beams_one_after_the_other_do_not_run_backwards():
    ring = np.repeat([0, 1], 200)
    assert judge_times([scan(np.tile(SWEEP, 2), ring=ring)], WHERE).warnings == ()


def test_a_zero_among_absolute_times_is_no_time():
    times = 1.6e9 + SWEEP
    times[[0, 50]] = 0.0
    np.testing.assert_allclose(sweep_bounds(times, 1.0), [times[1], times[-1]], atol=1e-6)
    np.testing.assert_allclose(to_scan(scan(times), WHERE).time[[1, 50, 199]], [0.0, SWEEP[50], 0.1], atol=1e-3)


def test_a_time_beyond_any_clock_is_none_and_takes_that_of_the_points_beside_it():
    times = SWEEP.copy()
    times[50] = 1e300
    assert judge_times([scan(times)], WHERE).warnings == ()
    np.testing.assert_allclose(to_scan(scan(times), WHERE).time, SWEEP, atol=1e-6)


def test_times_that_last_longer_than_any_sweep_are_told_where_the_gap_is_not_known():
    times = SWEEP.copy()
    times[50] = 1e12
    (warning,) = judge_times([scan(times)], WHERE).warnings
    assert "span 1e+03 s in any unit, which no sweep lasts; they are not used" in warning
