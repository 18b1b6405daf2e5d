"""Paths whose shapes are known."""

import numpy as np
import pytest

from automos.simulation.traffic.paths import STEP, connect, through


def test_a_straight_path_is_sampled_evenly_and_exactly():
    path = through([(0.0, 0.0), (30.0, 40.0)])
    assert path.length == pytest.approx(50.0)
    assert np.linalg.norm(np.diff(path.xy, axis=0), axis=1) == pytest.approx(STEP)
    xy, heading = path.at(25.0, offset=2.0)
    assert xy == pytest.approx([15.0 - 2.0 * 0.8, 20.0 + 2.0 * 0.6])
    assert heading == pytest.approx(np.arctan2(4, 3))


def test_a_corner_is_rounded_with_the_radius_asked_for():
    path = through([(0.0, 0.0), (50.0, 0.0), (50.0, 50.0)], radius=10.0)
    # Two legs of 40 m and a quarter circle.
    assert path.length == pytest.approx(80.0 + 5.0 * np.pi, abs=STEP)
    in_arc = np.abs(np.arange(len(path.xy)) * STEP - (40.0 + 2.5 * np.pi)) < 5.0
    assert path.curvature[in_arc] == pytest.approx(0.1, rel=0.02)
    assert np.linalg.norm(path.xy[in_arc] - (40.0, 10.0), axis=1) == pytest.approx(10.0, abs=0.02)


def test_a_path_beside_a_curve_keeps_its_distance():
    path = through([(0.0, 0.0), (100.0, 0.0), (150.0, 80.0)], radius=40.0)
    beside = path.beside(3.0)
    apart = np.linalg.norm(path.xy[:, None] - beside.xy[None, 10:-10], axis=2).min(axis=0)
    assert apart == pytest.approx(3.0, abs=0.05)


def test_a_change_of_lane_starts_on_one_line_and_ends_on_the_other():
    path = through([(0.0, 0.0), (200.0, 0.0)]).shifted(50.0, 40.0, 3.5)
    assert path.xy[path.xy[:, 0] < 50.0, 1] == pytest.approx(0.0, abs=1e-9)
    assert path.xy[path.xy[:, 0] > 90.0, 1] == pytest.approx(3.5, abs=1e-9)


def test_connecting_two_lines_follows_both():
    path = connect((-50, -2), (-10, -2), (2, 10), (2, 60), radius=6.0)
    assert path.xy[path.xy[:, 0] < -6.0, 1] == pytest.approx(-2.0, abs=1e-6)
    assert path.xy[path.xy[:, 1] > 6.0, 0] == pytest.approx(2.0, abs=1e-6)


def test_connecting_lines_that_continue_each_other_is_straight():
    path = connect((-50, 1), (-10, 1), (10, 1), (50, 1), radius=6.0)
    assert path.xy[:, 1] == pytest.approx(1.0)
    assert path.length == pytest.approx(100.0)
