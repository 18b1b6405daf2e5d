"""The way of a track in standard deviations of its sights."""

import numpy as np
import pytest

from automos.objects.face_paths import LEAST_SCATTER, SLIDES, path_terms, way_beyond


def way_of(x):
    """Return the term of the way of one track that is seen at `x` (N,), metres, ten times a second."""
    n = len(x)
    faces = np.column_stack([x, np.zeros((n, 2)), np.ones(n)])
    return float(path_terms(np.array([0, n]), 0.1 * np.arange(n), faces)[2][0])


def test_two_sights_say_nothing_of_a_way_whatever_lies_between():
    assert way_of(np.array([0.0, 3.0])) == 0.0


def test_a_way_counts_in_standard_deviations_of_its_mean():
    assert way_of(np.linspace(0.0, 5.0, 27)) == pytest.approx(np.log1p(5.0 * 5.0 / LEAST_SCATTER), abs=0.05)


def test_what_stands_for_minutes_after_a_slide_has_gone_no_farther():
    slid = np.minimum(0.1 * np.arange(900), 1.0)
    assert way_of(slid) == pytest.approx(way_of(slid[:90]), abs=0.2)


def test_what_jumps_about_has_hardly_a_way():
    jumps = np.tile([0.0, 1.0, -1.0, 0.5], 8)
    assert way_of(jumps) < way_of(np.linspace(0.0, 0.5, 32)) - 1.0


def beyond(left, right, sensor=0.0, period=0.1):
    """Return the term of the way of one track whose ends are at `left` and `right` (N,), metres along x, or NaN."""
    n = len(left)
    ends = np.stack([np.column_stack([x, np.full(n, y)]) for x, y in ((left, 9.0), (right, 8.0))], axis=1)
    ends[np.isnan(ends[..., 0])] = np.nan
    places = np.column_stack([np.broadcast_to(sensor, n), np.zeros(n)])
    return float(way_beyond(np.array([0, n]), period * np.arange(n), ends, places)[0])


WAY = np.linspace(0.0, 5.0, 28)


def test_the_way_of_both_ends_counts_in_standard_deviations_of_its_mean():
    assert beyond(WAY, WAY + 4.0) == pytest.approx(np.log1p(5.0 * 5.0 / LEAST_SCATTER), abs=0.05)


@pytest.mark.parametrize(
    "ends",
    [
        (WAY, np.full(28, 9.0)),  # more of a wall comes into sight
        (WAY, 9.0 - WAY),
        (WAY, np.full(28, np.nan)),  # something nearer passes
    ],
)
def test_what_changes_at_one_end_or_at_both_against_each_other_has_gone_no_way(ends):
    assert beyond(*ends) == 0.0


def test_what_the_sensors_own_way_explains_has_gone_no_way():
    assert beyond(WAY, WAY + 4.0, WAY / SLIDES) < beyond(WAY, WAY + 4.0, WAY / SLIDES / 2.0) - 3.0


def test_a_way_counts_from_where_the_sensor_stands():
    sets_off, brakes = np.maximum(WAY - 2.5, 0.0), np.minimum(WAY, 2.5)
    assert beyond(sets_off, sets_off + 4.0, 4.0 * brakes) > beyond(sets_off, sets_off + 4.0) - 0.2


def test_what_is_seen_again_after_a_while_may_be_another_thing():
    assert beyond(WAY, WAY + 4.0, period=0.5) == 0.0


def test_three_sights_say_nothing_of_what_the_ends_did():
    assert beyond(np.array([0.0, 30.0, 5.0]), np.array([1.0, 31.0, 6.0])) == 0.0
