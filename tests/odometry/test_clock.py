import numpy as np
import pytest

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.odometry.clock import LONGEST_GAP, RunningClock, read_clock

POINT = np.ones((1, 3), np.float32)


def clock_of(stamps):
    return read_clock(ArraySequence([POINT] * len(stamps), stamps=stamps))


@pytest.mark.parametrize("given", [np.zeros((2, 1)), np.zeros(3), 0.5, "now", [None, 1.0]], ids=repr)
def test_stamps_of_a_sequence_of_ones_own_that_are_not_one_for_each_scan_are_told(given):
    class Own(ArraySequence):
        stamps = given

    with pytest.raises(InputError, match="stamps must be"):
        read_clock(Own([POINT, POINT]))


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


def test_the_clock_goes_on_by_the_gaps():
    clock = read_clock(ArraySequence([np.zeros((1, 3))] * 3)).with_gaps(np.array([1.0, 2.0]))
    np.testing.assert_allclose(clock.stamps, [0.0, 0.1, 0.3])
    assert not clock.has_stamps


def test_a_gap_is_measured_by_the_usual_step_of_few_scans():
    clock = read_clock(ArraySequence([np.zeros((1, 3))] * 3, stamps=[0.0, 0.1, 0.6]))
    assert clock.period == pytest.approx(0.1)
    np.testing.assert_allclose(clock.gaps, [1.0, 5.0])


def test_a_pause_counts_for_some_seconds_at_most_whoever_waits_for_the_end():
    stamps = [0.0, 0.1, 0.2, 1e9, 1e9 + 0.1]
    running = RunningClock()
    gaps = [running.tick(stamp)[1] for stamp in stamps][1:]
    np.testing.assert_allclose(gaps, clock_of(stamps).gaps, rtol=0.01)
    assert gaps[2] == pytest.approx(LONGEST_GAP / 0.1)


def test_a_stamp_that_goes_back_is_a_gap_of_one_and_tells_no_period():
    running = RunningClock()
    gaps = [running.tick(stamp)[1] for stamp in (0.0, 0.1, 0.05, 0.05, 0.0)]
    assert gaps == [0.0, 1.0, 1.0, 1.0, 1.0]
    assert running.period == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        ([0.0, np.nan, 0.2], "memory has an invalid stamp of nan s"),
        ([0.0, 1e300, 2e300], "memory has an invalid stamp of 1e.300 s"),
        ([1.6e18, 1.6e18 + 1e8, 1.6e18 + 2e8], "1.6e.18 s: give stamps in seconds"),  # nanoseconds since 1970
        ([0.0, 0.2, 0.1], "memory: scan 2 is -0.1 s after the previous scan"),
        ([0.0, 0.0, 0.0], "stamps must be in seconds and increase"),
        ([0.0, 1e-9, 1.5e9], "scan 1 is 1e-09 s after the previous scan"),
        ([0.0, 1e-9, 2e-9], "usual period: 1e-09 s"),
    ],
)
def test_times_that_are_no_clock_are_told(stamps, message):
    with pytest.raises(InputError, match=message):
        clock_of(stamps)
