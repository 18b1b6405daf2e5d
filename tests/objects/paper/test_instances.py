import numpy as np
import pytest

from automos.objects.paper.instances import find_instances
from automos.settings import HdbscanSettings


def cube(x: float, seed: int = 0) -> np.ndarray:
    """Return 400 points filling a cube of 0.5 m on the ground around (x, 0): one segment even at eps 0.25."""
    points = np.random.default_rng(seed).uniform(-0.25, 0.25, (400, 3)) + np.array([x, 0.0, 0.25])
    return points.astype(np.float32)


SCENE = np.concatenate([cube(0.0, seed=0), cube(6.0, seed=1), cube(12.0, seed=2)])
IN_CUBE = np.repeat([0, 1, 2], 400)


def share(*of_cube: float) -> np.ndarray:
    """Return candidate scores of which in each cube the given share is 1, the rest 0."""
    return np.concatenate([(np.arange(400) < 400 * f).astype(float) for f in of_cube])


def find(points, is_candidate, is_eligible=None, **settings):
    is_eligible = np.ones(len(points), bool) if is_eligible is None else is_eligible
    return find_instances(points, is_candidate, is_eligible, HdbscanSettings(**settings))


def test_segments_with_enough_candidates_are_instances_and_others_are_not():
    found = find(SCENE, share(1.0, 0.4, 0.6))
    np.testing.assert_array_equal(found.ids, np.array([0, -1, 1])[IN_CUBE])
    np.testing.assert_allclose(found.boxes.score, [1.0, 0.6], atol=1e-6)
    # boxes are around means of 10 cm voxels, which may lie 5 cm inside
    np.testing.assert_allclose(found.boxes.center, [[0.0, 0.0, 0.25], [12.0, 0.0, 0.25]], atol=0.05)
    np.testing.assert_allclose(found.boxes.size, 0.5, atol=0.12)


@pytest.mark.parametrize(("min_score", "expected"), [(0.0, [0, 1, 2]), (0.3, [-1, 0, 1]), (0.9, [-1, -1, 0])])
def test_the_share_that_makes_an_instance_is_a_setting(min_score, expected):
    found = find(SCENE, share(0.1, 0.5, 1.0), min_score=min_score)
    np.testing.assert_array_equal(found.ids, np.array(expected)[IN_CUBE])


def test_points_that_may_not_belong_are_in_no_instance_and_do_not_bridge_two():
    bridge = np.column_stack([np.linspace(0.3, 5.7, 100), np.zeros(100), np.full(100, 0.05)]).astype(np.float32)
    points, score = np.concatenate([SCENE, bridge]), np.r_[share(1, 1, 1), np.ones(100)]
    bridged = find(points, score)
    assert len(bridged.boxes) == 2
    found = find(points, score, np.r_[np.ones(1200, bool), np.zeros(100, bool)])
    assert len(found.boxes) == 3
    assert (found.ids[1200:] == -1).all()


def test_two_as_good_as_both_together_are_one():
    # 0.8 m apart: one segment at eps 2 and 1, two at 0.5; 400 of 800 points are candidates either way
    points, is_candidate = np.concatenate([cube(0.0), cube(1.3, 1)]), np.repeat([1.0, 0.0], 400)
    found = find(points, is_candidate)
    assert len(found.boxes) == 1
    np.testing.assert_array_equal(found.ids, 0)
    np.testing.assert_allclose(found.boxes.score, 0.5)


def test_a_part_that_scores_higher_is_told_apart_where_the_rest_is_too_small_to_count():
    points, is_candidate = np.concatenate([cube(0.0), cube(1.3, 1)[:4]]), np.repeat([1.0, 0.0], [400, 4])
    found = find(points, is_candidate)
    np.testing.assert_array_equal(found.ids, np.repeat([0, -1], [400, 4]))
    np.testing.assert_allclose(found.boxes.score, 1.0)


def test_instances_do_not_depend_on_the_order_of_points():
    order = np.random.default_rng(3).permutation(len(SCENE))
    score = share(1.0, 0.4, 0.6)
    np.testing.assert_array_equal(find(SCENE[order], score[order]).ids, find(SCENE, score).ids[order])


@pytest.mark.parametrize("n", [0, 1, 3])
def test_few_points_are_no_instance(n):
    found = find(SCENE[:n], np.ones(n))
    np.testing.assert_array_equal(found.ids, np.full(n, -1))
    assert len(found.boxes) == 0


def test_few_points_in_one_voxel_weigh_as_many_as_they_are():
    points = np.full((5, 3), 0.05, np.float32) + np.linspace(0.0, 0.01, 5, dtype=np.float32)[:, None]
    assert len(find(points, np.ones(5)).boxes) == 1
    assert len(find(points[:4], np.ones(4)).boxes) == 0


def test_what_is_longer_than_allowed_is_no_instance():
    wall = np.column_stack([np.arange(0.0, 30.0, 0.1), np.zeros(300), np.zeros(300)]).astype(np.float32)
    assert len(find(wall, np.ones(300)).boxes) == 0
    assert len(find(wall, np.ones(300), max_side=40.0).boxes) == 1
