"""The way of a track in standard deviations of its sights."""

import numpy as np
import pytest

from automos.objects.face_paths import LEAST_SCATTER, path_terms


def way_of(x):
    """Return the term of the way of one track that is seen at `x` (N,), metres, ten times a second."""
    n = len(x)
    faces = np.column_stack([x, np.zeros((n, 2)), np.ones(n)])
    return float(path_terms(np.array([0, n]), 0.1 * np.arange(n), faces)[2][0])


def test_two_sights_say_nothing_of_a_way_whatever_lies_between():
    assert way_of(np.array([0.0, 3.0])) == 0.0


def test_a_way_counts_in_standard_deviations_of_its_mean():
    assert way_of(np.linspace(0.0, 5.0, 27)) == pytest.approx(np.log1p(5.0 * 5.0 / LEAST_SCATTER), abs=0.05)


def test_what_jumps_about_has_hardly_a_way():
    jumps = np.tile([0.0, 1.0, -1.0, 0.5], 8)
    assert way_of(jumps) < way_of(np.linspace(0.0, 0.5, 32)) - 1.0
