import numpy as np
import pytest

from automos.objects.occlusion import hidden_sides, nearest_points

STEPS = (0.02, 0.005)


def face(azimuths, distance, heights=(0.0, 0.3, 0.6)):
    """Return points on a cylinder about the sensor, at all `azimuths` and heights above the horizon."""
    turn, z = np.meshgrid(azimuths, heights)
    return np.stack([distance * np.cos(turn), distance * np.sin(turn), z], axis=-1).reshape(-1, 3)


def sides(*things, turn=0.0):
    """Return what is hidden of the first of `things`, points each, all turned about the sensor by `turn`."""
    c, s = np.cos(turn), np.sin(turn)
    points = np.vstack(things) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    ids = np.concatenate([np.full(len(thing), k, np.int32) for k, thing in enumerate(things)])
    return hidden_sides(ids, nearest_points(points.astype(np.float32), STEPS), len(things))[0].tolist()


CAR = face(np.arange(-0.1, 0.1, 0.005), 20.0)
TURNS = pytest.mark.parametrize("turn", [0.0, 1.0, np.pi, -2.0])


@TURNS
def test_a_pillar_in_front_of_its_left_end_hides_what_is_left(turn):
    assert sides(CAR, face(np.arange(0.1, 0.13, 0.005), 10.0), turn=turn) == [True, False]


@TURNS
def test_a_pillar_in_front_of_its_right_end_hides_what_is_right(turn):
    assert sides(CAR, face(np.arange(-0.13, -0.1, 0.005), 10.0), turn=turn) == [False, True]


def test_a_wall_behind_it_hides_nothing():
    assert sides(CAR, face(np.arange(-0.3, 0.3, 0.005), 30.0)) == [False, False]


def test_what_is_as_far_away_is_beside_it_and_hides_nothing():
    assert sides(CAR, face(np.arange(0.1, 0.2, 0.005), 19.8)) == [False, False]


def test_a_pillar_away_from_its_ends_hides_nothing():
    assert sides(CAR, face(np.arange(0.2, 0.23, 0.005), 10.0)) == [False, False]


def test_what_is_lower_than_most_of_its_edge_hides_nothing():
    assert sides(CAR, face(np.arange(0.1, 0.13, 0.005), 10.0, (-1.0, -0.9))) == [False, False]


def test_nothing_is_hidden_of_no_segments():
    assert hidden_sides(np.zeros(0, np.int32), nearest_points(np.zeros((0, 3), np.float32), STEPS), 0).shape == (0, 2)
    assert hidden_sides(np.full(3, -1, np.int32), nearest_points(CAR[:3].astype(np.float32), STEPS), 0).shape == (0, 2)
