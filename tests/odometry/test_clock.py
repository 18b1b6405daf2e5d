import numpy as np
import pytest

from automos.odometry.clock import read_clock
from automos.scan import ArraySequence

POINT = np.ones((1, 3), np.float32)


def clock_of(stamps):
    return read_clock(ArraySequence([POINT] * len(stamps), stamps=stamps))


def test_a_clock_of_two_decimals_is_an_even_one():
    clock = clock_of([0.0, 0.10, 0.21, 0.31, 0.41, 0.52])
    np.testing.assert_array_equal(clock.gaps, np.ones(5))
    assert clock.period == pytest.approx(0.104)


def test_missing_scans_make_a_gap_as_long_as_they_were():
    clock = clock_of([0.0, 0.1, 0.2, 0.5, 0.6])
    np.testing.assert_allclose(clock.gaps, [1.0, 1.0, 3.0, 1.0])
    assert clock.period == pytest.approx(0.1)


def test_without_a_clock_ten_scans_are_a_second():
    clock = read_clock(ArraySequence([POINT] * 3))
    np.testing.assert_allclose(clock.stamps, [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(clock.gaps, np.ones(2))


def test_one_scan_has_no_gaps():
    assert len(read_clock(ArraySequence([POINT])).gaps) == 0
