"""What a body is."""

import numpy as np
import pytest

from automos.objects.kinds import Kind, kind_probabilities, whole_extent


@pytest.mark.parametrize(
    ("shown", "speed", "kind"),
    [
        ((4.4, 1.8, 1.5), 12.0, Kind.CAR),
        ((0.5, 1.8, 1.4), 12.0, Kind.CAR),  # from behind
        ((11.0, 2.6, 3.2), 12.0, Kind.LARGE_VEHICLE),
        ((1.7, 0.6, 1.6), 6.0, Kind.TWO_WHEELER),
        ((0.6, 0.6, 1.75), 1.4, Kind.PERSON),
        ((40.0, 10.0, 9.0), 5.0, Kind.OTHER),
    ],
)
def test_extent_height_and_speed_say_what_it_is(shown, speed, kind):
    odds = kind_probabilities(np.array([shown]), np.array([speed]))
    assert odds.sum() == pytest.approx(1.0)
    assert odds[0].argmax() == kind


def test_what_was_not_shown_whole_is_at_least_that_of_its_kind():
    is_whole = np.array([[False, True, False], [True, False, False], [False, False, False]])
    shown = np.array([[0.5, 1.8, 1.4], [4.2, 0.4, 1.5], [5.2, 1.9, 1.7]])
    found = whole_extent(shown, is_whole, np.full(3, 12.0))
    np.testing.assert_allclose(found, [[4.5, 1.8, 1.6], [4.2, 1.85, 1.6], [5.2, 1.9, 1.7]])
