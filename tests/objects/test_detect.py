"""Segments as the evidence cuts them: objects, pieces, and what has stayed as a whole."""

import numpy as np

from automos.objects.detect import detect_objects
from automos.settings import DetectSettings

STEPS = (np.deg2rad(2.0), np.deg2rad(0.2))  # as far apart as the points of a block, 5 m away
MOVED, STAYED, UNKNOWN = 4.0, -4.0, 0.0


def block(x, y, length=2.0, width=1.0):
    """Points of a box-like thing, 1 m high."""
    u, v, z = np.meshgrid(np.arange(0, length, 0.2), np.arange(0, width, 0.2), np.arange(0.2, 1.2, 0.2))
    return np.column_stack([x + u.ravel(), y + v.ravel(), z.ravel()])


def detect(*things):
    """Detect objects among (points, log-odds) pairs."""
    points = np.concatenate([p for p, _ in things]).astype(np.float32)
    log_odds = np.concatenate([np.broadcast_to(s, len(p)) for p, s in things])
    solid = np.full(len(points), 255, np.uint8)
    return detect_objects(points, np.zeros(3), log_odds, points[:, 2], solid, STEPS, DetectSettings())


def test_a_thing_of_which_the_evidence_speaks_with_one_voice_is_one_object():
    car = block(5, 0)
    mostly = np.where(np.arange(len(car)) % 3 == 0, UNKNOWN, MOVED)
    objects, stayed, found = detect((car, mostly))
    assert set(objects) == {0}
    assert set(stayed) == {-1}
    assert found.n_points.tolist() == [len(car)]
    assert found.n_moving.tolist() == [(mostly == MOVED).sum()]


def test_what_has_stayed_is_kept_whole_and_apart():
    objects, stayed, found = detect((block(5, 0), STAYED), (block(12, 0), MOVED))
    n = len(block(5, 0))
    assert set(objects[:n]) == {-1}
    assert set(objects[n:]) == {0}
    assert set(stayed[:n]) == {1}
    assert set(stayed[n:]) == {-1}
    assert found.has_stayed.tolist() == [False, True]
    assert found.n_static.tolist() == [0, n]


def test_a_segment_is_lifted_by_what_is_under_it():
    car, crown = block(5, 0), block(12, 0) + np.array([0.0, 0.0, 3.0])
    _, _, found = detect((car, MOVED), (crown, STAYED))
    np.testing.assert_allclose(found.lift, [0.2, 3.2], atol=1e-6)


def test_a_walker_at_a_wall_is_cut_off_it():
    wall, walker = block(5, 0, 0.4, 8.0), block(5.4, 3.0, 0.4, 0.6)
    objects, stayed, found = detect((wall, STAYED), (walker, MOVED))
    assert set(objects[: len(wall)]) == {-1}
    assert set(objects[len(wall) :]) == {0}
    assert set(stayed) == {1}  # and the two as a whole have stayed
    assert found.part_of.tolist() == [1, -1]
    assert found.has_stayed.tolist() == [False, True]


def test_a_walker_at_a_long_wall_is_cut_off_the_points_of_it_of_which_nothing_is_known():
    wall, walker = block(5, 0, 0.4, 24.0), block(5.4, 3.0, 0.4, 0.6)
    is_beside = (np.abs(wall[:, 1] - 3.3) < 1.2) & (np.arange(len(wall)) % 2 == 0)
    objects, _, found = detect((wall, np.where(is_beside, UNKNOWN, STAYED)), (walker, MOVED))
    assert is_beside.sum() > len(walker)
    assert set(objects[len(wall) :]) == {0}
    assert (objects[: len(wall)] >= 0).sum() < len(walker)
    assert found.part_of.tolist() == [1, -1]


def test_of_a_tram_of_which_much_is_unknown_no_person_is_cut():
    tram = block(5, -15, 0.4, 30.0)
    said = np.where(np.arange(len(tram)) % 2 == 0, UNKNOWN, STAYED)
    said[np.abs(np.abs(tram[:, 1]) - 12.8) < 0.7] = MOVED
    objects, stayed, _ = detect((tram, said))
    assert set(objects) == {-1}
    assert set(stayed) == {0}


def test_nothing_gives_nothing():
    objects, stayed, found = detect((np.zeros((0, 3)), 0.0))
    assert len(objects) == len(stayed) == len(found) == 0


def test_a_lorry_of_which_only_the_ends_have_left_their_place_stays_whole():
    lorry = block(5, 0, 8.0, 2.0)
    log_odds = np.where(np.abs(lorry[:, 0] - 9.0) > 1.5, MOVED, STAYED)
    objects, _, found = detect((lorry, log_odds))
    assert set(objects) == {0}
    assert found.n_static.tolist() == [(log_odds == STAYED).sum()]
