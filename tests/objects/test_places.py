"""What stands beside a mover is static, although it is one segment with it."""

import numpy as np
import pytest

from automos.core.upright_boxes import Boxes
from automos.objects.places import OUTNUMBERED, SIDE, Places, count_places, held_places, touched_columns

BIN = np.array([[5.0, 0.1, z] for z in (0.1, 0.4, 0.7)], np.float32)
WALKER = np.array([[0.0, 0.5, z] for z in (0.1, 0.4, 0.7, 1.0, 1.3)], np.float32)


def walk(n_scans=11):
    """Yield scans of a walker who passes a bin at 1 m a scan: points, and which of them a moving track has."""
    for x in range(n_scans):
        walker = WALKER + np.array([x, 0.0, 0.0], np.float32)
        has_met = abs(x - 5) <= 1  # then they are one segment
        yield np.concatenate([BIN, walker]), np.repeat([has_met, True], [len(BIN), len(walker)])


def boxes(n_scans=11):
    center = np.column_stack([np.arange(n_scans), np.full(n_scans, 0.5), np.full(n_scans, 0.7)]).astype(float)
    return Boxes(center, np.tile([0.5, 0.5, 1.5], (n_scans, 1)), np.zeros(n_scans), np.ones(n_scans))


def places_of(scans, boxes):
    columns = touched_columns(boxes)
    held = (held_places(points, moves, ~moves, columns) for points, moves in scans)
    return Places(count_places(held), np.array([True]))


def test_the_bin_that_a_walker_passes_is_static_and_the_walker_is_not():
    places = places_of(walk(), boxes())
    points, _ = list(walk())[5]
    np.testing.assert_array_equal(
        places.static_points(points, np.zeros(len(points), np.int32)), [True] * 3 + [False] * 5
    )


def test_the_middle_of_a_tram_whose_place_it_held_itself_is_not_static():
    middle = np.column_stack([np.arange(0.0, 20.0, 0.25), np.zeros(80), np.ones(80)]).astype(np.float32)
    scans = [(middle + np.array([x, 0, 0], np.float32), np.ones(80, bool)) for x in range(10)]
    length = Boxes(np.array([[14.5, 0.0, 1.0]]), np.array([[29.0, 2.0, 2.0]]), np.zeros(1), np.ones(1))
    assert not len(places_of(scans, length).keys)


def test_points_of_no_track_and_of_tracks_that_were_not_counted_as_movers_stay_as_they_are():
    places = places_of(walk(), boxes())
    both = Places(places.keys, np.array([True, False]))
    np.testing.assert_array_equal(both.static_points(BIN, np.array([0, 1, -1], np.int32)), [True, False, False])


def test_only_a_place_that_stays_has_held_in_many_more_scans_is_taken_from_a_mover():
    scans = [(BIN[:1], np.array([moves])) for moves in (True, *[False] * OUTNUMBERED)]
    assert not len(places_of(scans, boxes()).keys)
    assert len(places_of([*scans, (BIN[:1], np.array([False]))], boxes()).keys) == 1


def test_what_nobody_knows_of_speaks_for_neither():
    columns, unknown = touched_columns(boxes()), np.zeros(3, bool)
    held, _ = held_places(BIN, unknown, unknown, columns)
    assert not len(held)


def test_a_place_that_nothing_moving_ever_held_is_not_remembered():
    assert not len(places_of([(BIN, np.zeros(3, bool))] * 3, boxes()).keys)


def test_places_added_up_in_parts_are_the_same(monkeypatch):
    whole = places_of(walk(), boxes()).keys
    monkeypatch.setattr("automos.objects.places._AT_ONCE", 3)
    np.testing.assert_array_equal(places_of(walk(), boxes()).keys, whole)


@pytest.mark.parametrize("yaw", [0.0, 0.7, np.pi / 2])
def test_every_point_of_a_box_lies_in_a_column_that_it_touches(yaw):
    rng = np.random.default_rng(0)
    box = Boxes(np.array([[-3.3, 8.1, 1.0]]), np.array([[12.0, 2.5, 3.0]]), np.array([yaw]), np.ones(1))
    u, v = rng.uniform(-6, 6, 500), rng.uniform(-1.25, 1.25, 500)
    c, s = np.cos(yaw), np.sin(yaw)
    points = np.column_stack([-3.3 + c * u - s * v, 8.1 + s * u + c * v, rng.uniform(-0.5, 2.5, 500)])
    held, _ = held_places(points.astype(np.float32), *np.ones((2, 500), bool), touched_columns(box))
    assert set(held) == set(held_places(points.astype(np.float32), *np.ones((2, 500), bool), everywhere())[0])


def test_a_place_may_contain_both_what_moves_and_what_stays():
    _, both = held_places(BIN, np.array([True, True, False]), np.array([False, True, True]), everywhere())
    assert both.tolist() == [[True, False], [True, True], [False, True]]


def everywhere():
    far = Boxes(np.zeros((1, 3)), np.array([[40.0, 40.0, 1.0]]), np.zeros(1), np.ones(1))
    return touched_columns(far)


def test_a_place_is_as_wide_as_it_says():
    columns = everywhere()
    near, _ = held_places(np.array([[0.01, 0.01, 0.01], [SIDE - 0.01] * 3]), *np.ones((2, 2), bool), columns)
    assert len(near) == 1
    apart, _ = held_places(np.array([[0.01, 0.01, 0.01], [SIDE + 0.01] * 3]), *np.ones((2, 2), bool), columns)
    assert len(apart) == 2
