from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from automos.odometry.missing_scans import TRIED, count_missing, find_missing, refound_after, with_gaps
from automos.odometry.motion import chain
from automos.odometry.surfels import surfels_of
from automos.odometry.window import Window
from automos.settings import OdometrySettings

STEP = 1.1


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
    np.testing.assert_array_equal(find_missing(steps_of(lengths), np.ones(20), 0.1, 3.0), expected)


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
    np.testing.assert_array_equal(find_missing(steps_of(lengths), np.ones(20), 0.1, 3.0), np.ones(20))


@pytest.mark.parametrize("refound", [0.0, 2.5])
def test_what_is_found_again_outweighs_a_registration_that_follows_traffic(refound):
    at_gaps = np.zeros((20, len(TRIED)))
    at_gaps[9, 1] = refound
    found = find_missing(steps_of(np.full(20, STEP)), np.ones(20), 0.1, 3.0, at_gaps)
    assert found[9] == (2.0 if refound else 1.0)
    assert (np.delete(found, 9) == 1.0).all()


def test_what_is_found_again_at_every_step_is_no_gap():
    at_gaps = np.zeros((20, len(TRIED)))
    at_gaps[:, 0] = 2.5
    lengths = np.full(20, STEP)
    lengths[7] = 2.0 * STEP  # a registration that has slipped
    np.testing.assert_array_equal(find_missing(steps_of(lengths), np.ones(20), 0.1, 3.0, at_gaps), np.ones(20))


def recesses(n=400):
    """Return points of squares of a metre that face along x, at random beside a straight path."""
    rng = np.random.default_rng(4)
    middle = np.stack([rng.uniform(-20.0, 60.0, n), rng.choice([-1, 1], n) * rng.uniform(4.0, 11.0, n)], axis=1)
    y, z = np.meshgrid(np.arange(-0.5, 0.5, 0.1), np.arange(-1.0, 2.0, 0.1))
    squares = np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1)
    return (np.column_stack([middle, np.zeros(n)])[:, None] + squares).reshape(-1, 3)


def drive(lengths, registered):
    """Return a window of scans `lengths` apart whose steps were registered to be `registered`."""
    world, surfels = recesses(), []
    for x in np.append(0.0, np.cumsum(lengths)):
        points = (world - [x, 0.0, 0.0]).astype(np.float32)
        surfels.append(surfels_of(points[np.linalg.norm(points, axis=1) < 30.0], None))
    T = chain(np.eye(4), steps_of(registered))
    return Window(surfels, np.zeros((len(T), 6)), T, np.ones(len(registered)), 0.1, 0.0)


def shown(lengths, registered, pool=None):
    return refound_after(drive(lengths, registered), OdometrySettings().overhead, pool)


def test_the_twofold_step_is_found_whatever_the_registration_says():
    lengths = np.full(12, STEP)
    lengths[[4, 9]] = 2.0 * STEP
    shares = shown(lengths, np.full(12, STEP))
    np.testing.assert_array_equal(TRIED[shares.argmax(axis=1)], np.where(lengths > STEP, 2.0, 1.0))
    assert shares.max() <= 3.0
    found = find_missing(steps_of(np.full(12, STEP)), np.ones(12), 0.1, 3.0, shares)
    np.testing.assert_array_equal(found, np.where(lengths > STEP, 2.0, 1.0))


def test_threads_change_nothing():
    lengths = np.full(9, STEP)
    with ThreadPoolExecutor(3) as pool:
        np.testing.assert_array_equal(shown(lengths, lengths, pool), shown(lengths, lengths))


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_a_few_scans_have_few_steps(n):
    assert shown(np.full(n, STEP), np.full(n, STEP)).shape == (n, len(TRIED))


def test_who_hardly_moves_is_told_nothing():
    assert not shown(np.full(8, 0.05), np.full(8, 0.05)).any()


def test_a_missing_scan_is_found_where_registrations_are_too_short():
    """No step sticks out of the registered ones; at the true speed, one does."""
    lengths = np.full(16, STEP)
    lengths[9] = 2.0 * STEP
    window = drive(lengths, np.full(16, 0.6 * STEP))
    assert (find_missing(window.steps, window.gaps, 0.1, 3.0) == 1.0).all()
    found = count_missing(window, OdometrySettings())
    np.testing.assert_array_equal(found, np.where(lengths > STEP, 2.0, 1.0))


def test_steps_grow_with_their_gaps():
    window, gaps = drive(np.full(8, STEP), np.full(8, STEP)), np.ones(8)
    gaps[[0, 5]] = 3.0
    longer = with_gaps(window, gaps)
    np.testing.assert_allclose(longer.steps[:, 0, 3], STEP * gaps, atol=1e-9)
    np.testing.assert_allclose(longer.clock, 0.1 * np.append(0.0, np.cumsum(gaps)))
