from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from automos.array_sequence import ArraySequence
from automos.errors import InputError
from automos.odometry.clock import TRIED, FacingGaps, find_missing, read_clock
from automos.odometry.surfels import surfels_of
from automos.settings import OdometrySettings

POINT = np.ones((1, 3), np.float32)
STEP = 1.1


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


def steps_of(lengths):
    steps = np.tile(np.eye(4), (len(lengths), 1, 1))
    steps[:, 0, 3] = lengths
    return steps


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_a_step_of_several_lengths_amid_even_ones_is_a_gap(missing):
    lengths = np.full(20, 1.3) + 0.01 * np.arange(20)
    lengths[[6, 13, 19]] *= 1 + missing
    expected = np.ones(20)
    expected[[6, 13, 19]] = 1 + missing
    np.testing.assert_array_equal(find_missing(steps_of(lengths), np.ones(20), 0.1), expected)


@pytest.mark.parametrize(
    "lengths",
    [
        np.repeat([0.65, 1.3], 10),  # a registration that lets go of the traffic
        np.linspace(0.0, 0.6, 20),  # a start
        np.where(np.arange(20) == 8, 0.16, 0.08),  # centimetres, which registrations are off by
        np.where(np.arange(20) == 8, 1.95, 1.3),  # no whole number of scans
        np.zeros(20),
    ],
    ids=["leap", "start", "creeping", "one and a half", "standing"],
)
def test_what_no_missing_scan_explains_is_no_gap(lengths):
    np.testing.assert_array_equal(find_missing(steps_of(lengths), np.ones(20), 0.1), np.ones(20))


@pytest.mark.parametrize("refound", [0.0, 2.5])
def test_what_is_found_again_outweighs_a_registration_that_follows_traffic(refound):
    at_gaps = np.zeros((20, len(TRIED)))
    at_gaps[9, 1] = refound
    found = find_missing(steps_of(np.full(20, STEP)), np.ones(20), 0.1, at_gaps)
    assert found[9] == (2.0 if refound else 1.0)
    assert (np.delete(found, 9) == 1.0).all()


def test_what_is_found_again_at_every_step_is_no_gap():
    at_gaps = np.zeros((20, len(TRIED)))
    at_gaps[:, 0] = 2.5
    lengths = np.full(20, STEP)
    lengths[7] = 2.0 * STEP  # a registration that has slipped
    np.testing.assert_array_equal(find_missing(steps_of(lengths), np.ones(20), 0.1, at_gaps), np.ones(20))


def recesses(n=400):
    """Return points of squares of a metre that face along x, at random beside a straight path."""
    rng = np.random.default_rng(4)
    middle = np.stack([rng.uniform(-20.0, 60.0, n), rng.choice([-1, 1], n) * rng.uniform(4.0, 11.0, n)], axis=1)
    y, z = np.meshgrid(np.arange(-0.5, 0.5, 0.1), np.arange(-1.0, 2.0, 0.1))
    squares = np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1)
    return (np.column_stack([middle, np.zeros(n)])[:, None] + squares).reshape(-1, 3)


def shown(lengths, registered, workers=1):
    """Return the shares at each gap of scans `lengths` apart whose steps were registered to be `registered`."""
    with ThreadPoolExecutor(workers) as pool:
        world, asked = recesses(), FacingGaps(0.0, OdometrySettings(), pool)
        for x, T in zip(np.append(0.0, np.cumsum(lengths)), [np.eye(4), *steps_of(registered)], strict=True):
            points = (world - [x, 0.0, 0.0]).astype(np.float32)
            surfels = pool.submit(surfels_of, points[np.linalg.norm(points, axis=1) < 30.0], None)
            asked.add(surfels, T, 1.0)
        return asked.shares()


def test_the_twofold_step_is_found_whatever_the_registration_says():
    lengths = np.full(12, STEP)
    lengths[[4, 9]] = 2.0 * STEP
    shares = shown(lengths, np.full(12, STEP))
    np.testing.assert_array_equal(TRIED[shares.argmax(axis=1)], np.where(lengths > STEP, 2.0, 1.0))
    assert shares.max() <= 3.0
    found = find_missing(steps_of(np.full(12, STEP)), np.ones(12), 0.1, shares)
    np.testing.assert_array_equal(found, np.where(lengths > STEP, 2.0, 1.0))


def test_threads_change_nothing():
    lengths = np.full(9, STEP)
    np.testing.assert_array_equal(shown(lengths, lengths, workers=3), shown(lengths, lengths))


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_a_few_scans_have_few_steps(n):
    assert shown(np.full(n, STEP), np.full(n, STEP)).shape == (n, len(TRIED))


def test_who_hardly_moves_is_told_nothing():
    assert not shown(np.full(8, 0.1), np.full(8, 0.1)).any()
