"""Times in the names of scans: dates and numbers wherever they stand, in the order of time; counters are none."""

from datetime import UTC, datetime

import numpy as np
import pytest

from automos.readers.scan_times import stamps_from_names

TIMES = datetime(2023, 5, 1, 12, 59, 58, tzinfo=UTC).timestamp() + 0.25 * np.arange(20)  # over the end of an hour


def date(seconds, form):
    return datetime.fromtimestamp(seconds, UTC).strftime(form)


NAMES = {
    "a date with a fraction": lambda k, t: date(t, "%Y-%m-%dT%H-%M-%S.%f"),
    "a date of digits alone": lambda k, t: f"lidar_{date(t, '%Y%m%d_%H%M%S_%f')}",
    "a date in one word": lambda k, t: date(t, "%Y%m%d%H%M%S%f"),
    "a date, then a counter": lambda k, t: f"{date(t, '%Y_%m_%d_%H_%M_%S_%f')} (frame {k})",
    "nanoseconds, then a counter": lambda k, t: f"{round(1e9 * t)}_{k:04d}",
    "a counter, then seconds, then the beams": lambda k, t: f"{k:06d}_{t:.3f}_os128",
    "seconds and nanoseconds": lambda k, t: f"{int(t)}_{round(1e9 * (t % 1)):09d}",
    "nanoseconds not filled up": lambda k, t: f"{int(t)}.{round(1e9 * (t % 1)) or 1}",
}


@pytest.mark.parametrize("name", NAMES)
def test_times_are_found_wherever_they_stand(name):
    stamps = stamps_from_names([NAMES[name](k, t) for k, t in enumerate(TIMES)])
    np.testing.assert_allclose(stamps, TIMES, atol=1e-6)


def test_nanoseconds_of_a_clock_that_began_with_the_sensor_are_times():
    since = 105.123 + 0.2 * np.arange(9) + 1e-4 * np.random.default_rng(0).normal(size=9)
    stamps = stamps_from_names([f"os1_{k:03d}_{round(1e9 * t)}" for k, t in enumerate(since)])
    np.testing.assert_allclose(stamps, since, atol=1e-8)
    codes = np.random.default_rng(0).integers(10**9, 10**11, 50)
    assert stamps_from_names([f"{code}" for code in codes]) is None


COUNTERS = {
    "numbers": lambda k, t: f"{k:06d}",
    "numbers behind a day": lambda k, t: f"2011_09_26_drive_0005_{k:010d}",
    "numbers behind the time of the first": lambda k, t: f"{date(TIMES[0], '%Y-%m-%d-%H-%M-%S')}_{k:04d}",
    "numbers that look like a time of day": lambda k, t: f"20110926_0005_{k:04d}",
    "no time of a day": lambda k, t: f"20231345{k:02d}6199",
    "the microseconds alone": lambda k, t: f"{round(1e6 * (t % 1)):06d}",
    "numbers in some alone": lambda k, t: f"{t:.3f}" if k else "first",
}


@pytest.mark.parametrize("name", COUNTERS)
def test_counters_are_no_times(name):
    assert stamps_from_names([COUNTERS[name](k, t) for k, t in enumerate(TIMES)]) is None


def test_one_name_is_no_clock():
    assert stamps_from_names(["1617000000.5"]) is None
    assert stamps_from_names([]) is None
