from pathlib import Path

import numpy as np
import pytest

from automos.readers.time_order import put_in_order, with_all_times

WHERE = Path("log")


def names(n):
    return [f"{i:03d}" for i in range(n)]


def test_scans_in_order_are_left_alone():
    stamps = np.array([0.0, 0.1, 0.35, 0.4])
    found = put_in_order(stamps, names(4), WHERE)
    np.testing.assert_array_equal(found.order, range(4))
    np.testing.assert_array_equal(found.stamps, stamps)
    assert found.warnings == []


def test_scans_out_of_order_are_sorted_and_the_first_is_named():
    found = put_in_order(np.array([0.0, 0.1, 1.0, 1.1, 0.2, 0.3]), names(6), WHERE)
    np.testing.assert_array_equal(found.order, [0, 1, 4, 5, 2, 3])
    assert "scan 004 is 0.90 s before the one that comes ahead of it, 003" in found.warnings[0]


def test_a_clock_that_was_set_back_does_not_mix_the_scans():
    stamps = np.concatenate([0.1 * np.arange(30), 1.43 + 0.1 * np.arange(30)])  # back by 1.5 s after the 30th
    found = put_in_order(stamps, names(60), WHERE)
    np.testing.assert_array_equal(found.order, range(60))
    np.testing.assert_allclose(np.diff(found.stamps), 0.1)
    assert "jumps back at 1 scans (scan 030 is 1.47 s before" in found.warnings[0]


def test_scans_of_one_time_are_set_apart_up_to_the_next():
    found = put_in_order(np.array([0.0, 0.1, 0.1, 0.2, 0.2]), names(5), WHERE)
    np.testing.assert_allclose(found.stamps, [0.0, 0.1, 0.15, 0.2, 0.25])
    assert "2 scans have the time of the one before them (first: 002)" in found.warnings[0]


@pytest.mark.parametrize("stamps", [np.zeros(5), np.array([0.0, 0.1, np.nan, 0.3, 0.4])])
def test_a_clock_that_stands_or_has_no_time_is_none(stamps):
    found = put_in_order(stamps, names(5), WHERE)
    assert found.stamps is None
    assert "is not used" in found.warnings[0]


def test_times_that_no_clock_tells_apart_are_one():
    found = put_in_order(np.array([0.0, 0.1, 0.2, 1e-320, 0.4]), names(5), WHERE)
    np.testing.assert_array_equal(found.order, [0, 3, 1, 2, 4])
    assert np.diff(found.stamps).min() > 0.01
    assert any("1 scans have the time of the one before them (first: 003)" in warning for warning in found.warnings)


@pytest.mark.parametrize("hours", [3600.0, 7200.0])
def test_a_clock_set_back_to_before_the_first_scan_does_not_put_the_second_half_first(hours):
    stamps = 3599.0 + 0.1 * np.arange(20)
    stamps[11:] -= hours
    found = put_in_order(stamps, names(20), WHERE)
    np.testing.assert_array_equal(found.order, range(20))
    np.testing.assert_allclose(np.diff(found.stamps), 0.1)
    assert "the clock jumps back at 1 scans" in found.warnings[0]


def test_two_halves_that_fit_together_the_other_way_round_are_put_so():
    found = put_in_order(np.r_[2.0 + 0.1 * np.arange(20), 0.1 * np.arange(20)], names(40), WHERE)
    np.testing.assert_array_equal(found.order, [*range(20, 40), *range(20)])


@pytest.mark.parametrize("back", [0.15, 0.34, 1.5, 2.5, 10.0, 45.0, 3600.0])
@pytest.mark.parametrize("jitter", [0.0, 0.004])
def test_a_clock_set_back_by_any_time_leaves_the_scans_as_they_came(back, jitter):
    stamps = 100.0 + 0.1 * np.arange(40) + jitter * np.random.default_rng(3).normal(size=40)
    stamps[20:] -= back
    found = put_in_order(stamps, names(40), WHERE)
    np.testing.assert_array_equal(found.order, range(40))
    np.testing.assert_allclose(np.diff(found.stamps), 0.1, atol=10 * jitter + 1e-9)
    assert "the clock jumps back at 1 scans" in found.warnings[0]


@pytest.mark.parametrize("lost", [0, 5])
def test_scans_that_came_late_are_put_in_their_place(lost):
    true = np.delete(0.1 * np.arange(40), range(30, 30 + lost))
    came = np.arange(len(true))
    came[[7, 8, 20, 21, 22]] = [8, 7, 22, 20, 21]
    found = put_in_order(true[came], names(len(true)), WHERE)
    np.testing.assert_array_equal(came[found.order], range(len(true)))
    np.testing.assert_array_equal(found.stamps, true)


STAMPS = 1_500_000_000.0 + 0.1 * np.arange(12)


def test_scans_without_a_time_get_one_between_those_beside_them():
    nan = np.nan
    times = with_all_times(np.array([nan, 5.0, 5.1, nan, 5.3, 5.4, 5.5, nan, nan]))
    np.testing.assert_allclose(times, 4.9 + 0.1 * np.arange(9))
    np.testing.assert_allclose(with_all_times(np.array([1.0, nan, 1.2])), [1.0, 1.1, 1.2])
    few = np.array([nan, nan, 1.0, 1.1, 1.2, nan, nan])
    np.testing.assert_array_equal(with_all_times(few), few)
