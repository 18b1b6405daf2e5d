from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from automos.objects.paper.hierarchy import choose_segments, cluster_nested

EPSILONS = (2.0, 1.0, 0.5, 0.25)


def partition(ids) -> set[frozenset[int]]:
    """Return which rows go together, whatever they are called; -1 is no segment."""
    return {frozenset(np.flatnonzero(ids == k).tolist()) for k in np.unique(ids) if k >= 0}


# ---------------------------------------------------------------------------------------------------- the eps tree
def components(points: np.ndarray, eps: float, min_samples: int) -> np.ndarray:
    """Return connected components of the graph of mutual reachability, straight from its definition."""
    distance = cdist(points, points)
    # row by row the sorted distances begin with the point itself, which is not its own neighbour
    core = np.sort(distance, axis=1)[:, min_samples] if len(points) > min_samples else np.zeros(len(points))
    reachability = np.maximum(distance, np.maximum(core[:, None], core[None, :]))
    return connected_components(reachability <= eps)[1]


@given(st.integers(0, 10**6), st.integers(1, 90), st.sampled_from([1, 2, 5]), st.sampled_from([0.1, 0.5, 3.0]))
def test_segments_are_the_components_of_mutual_reachability(seed, n, min_samples, spread):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-4, 4, (5, 3))[rng.integers(0, 5, n)] + rng.normal(0.0, spread, (n, 3))
    nested = cluster_nested(points.astype(np.float32), EPSILONS, min_samples)
    assert nested.shape == (4, n)
    for ids, eps in zip(nested, EPSILONS, strict=True):
        assert partition(ids) == partition(components(points.astype(np.float32).astype(float), eps, min_samples))


@given(st.integers(0, 10**6), st.integers(2, 60))
def test_segments_are_nested_and_numbered_without_gaps(seed, n):
    points = np.random.default_rng(seed).normal(0.0, 1.0, (n, 3))
    nested = cluster_nested(points, EPSILONS, 5)
    for coarse, fine in pairwise(nested):
        assert all(any(child <= parent for parent in partition(coarse)) for child in partition(fine))
    for ids in nested:
        np.testing.assert_array_equal(np.unique(ids), np.arange(ids.max() + 1))


def test_segments_of_points_on_a_line_by_hand():
    x = np.array([0.0, 0.2, 0.4, 1.2, 1.4, 3.0])  # gaps 0.2, 0.2, 0.8, 0.2, 1.6
    points = np.column_stack([x, np.zeros((6, 2))])
    nested = cluster_nested(points, EPSILONS, min_samples=1)
    np.testing.assert_array_equal(nested, [[0] * 6, [0] * 5 + [1], [0, 0, 0, 1, 1, 2], [0, 0, 0, 1, 1, 2]])
    # with two neighbours 1.2 and 1.4 are dense only at 0.8 and 1.0, and 3.0 only at 1.8
    nested = cluster_nested(points, (1.8, 1.0, 0.79, 0.2), min_samples=2)
    np.testing.assert_array_equal(nested, [[0] * 6, [0] * 5 + [1], [0, 0, 0, 1, 2, 3], [0, 1, 2, 3, 4, 5]])


@pytest.mark.parametrize("n", [0, 1])
def test_no_point_and_one_point_are_trees_too(n):
    np.testing.assert_array_equal(cluster_nested(np.zeros((n, 3), np.float32), EPSILONS, 5), np.zeros((4, n)))


def test_equal_points_are_one_segment_at_every_eps():
    assert not cluster_nested(np.ones((40, 3)), EPSILONS, 5).any()


# ----------------------------------------------------------------------------------------------------- the choice
def choose(nested, score, weight=None, min_points=2, max_side=20.0, x=None):
    nested = np.atleast_2d(np.array(nested, np.int32))
    n = nested.shape[1]
    weight = np.ones(n) if weight is None else np.array(weight, float)
    points = np.zeros((n, 3)) if x is None else np.column_stack([x, np.zeros((n, 2))])
    return choose_segments(nested, weight, np.array(score, float), min_points, max_side, points)


@pytest.mark.parametrize(
    ("nested", "score", "options", "ids", "scores"),
    [
        ([0, 0, 1, 1], [1, 0, 1, 1], {}, [0, 0, 1, 1], [0.5, 1.0]),
        ([[0, 0, 0, 0], [0, 0, 1, 1]], [1, 1, 0, 0], {}, [0, 0, 0, 0], [0.5]),
        ([[0, 0, 0, 0], [0, 0, 1, 1]], [1, 1, 1, 1], {}, [0, 0, 0, 0], [1.0]),
        ([[0, 0, 0], [0, 0, 1]], [1, 1, 0], {}, [0, 0, -1], [1.0]),
        ([[0, 0, 0], [0, 0, 1]], [0, 0, 1], {}, [0, 0, 0], [1 / 3]),
        ([[0, 0, 0], [0, 0, 1]], [1, 1, 0], {"weight": [1, 1, 2]}, [0, 0, 0], [0.5]),
        ([[0, 0], [0, 1]], [1, 0], {}, [0, 0], [0.5]),
        ([[0, 0], [0, 1]], [1, 0], {"weight": [3, 1]}, [0, -1], [1.0]),
        ([[0, 0, 0, 0], [0, 0, 1, 1]], [1, 1, 0, 0], {"x": [0, 1, 30, 31]}, [0, 0, 1, 1], [1.0, 0.0]),
        ([[0, 0, 0, 0], [0, 0, 1, 1]], [1, 1, 0, 0], {"x": [0, 20, 10, 10]}, [0, 0, 0, 0], [0.5]),
        ([[0, 0, 0], [0, 1, 2]], [1, 1, 0], {"x": [0, 30, 60]}, [-1, -1, -1], []),
        ([[0, 0, 0], [0, 1, 1]], [1, 1, 0], {"x": [0, 30, 31]}, [-1, 0, 0], [0.5]),
        ([0, 1, 2], [1, 1, 1], {}, [-1, -1, -1], []),
        (
            [[0] * 6, [0, 0, 0, 0, 1, 1], [0, 0, 1, 2, 3, 3]],
            [1, 1, 0, 0, 0.8, 0.8],
            {},
            [1, 1, -1, -1, 0, 0],
            [0.8, 1.0],
        ),
        ([[0] * 4, [0] * 4, [0, 0, 1, 1]], [1, 1, 0, 0], {}, [0] * 4, [0.5]),
        ([[0] * 4, [0, 0, 0, 1], [0, 0, 1, 2]], [1, 1, 0, 0], {}, [0, 0, -1, -1], [1.0]),
    ],
    ids=[
        "one level: every segment and its share",
        "children as good as the parent together: parent",
        "children as good as the parent each: parent",
        "the one child that counts is better: it",
        "the one child that counts is worse: parent",
        "a row of two points counts: parent again",
        "no child counts: parent",
        "a row of three points is a segment: it",
        "parent too long: children",
        "parent just as long as allowed: parent",
        "parent too long and no child counts: nothing",
        "parent too long: the child that counts",
        "too few points: nothing",
        "grandchild better through its uncle's level",
        "a parent equal to its child is kept at the coarsest",
        "better only two levels down: the grandchild",
    ],
)
def test_the_choice_on_trees_by_hand(nested, score, options, ids, scores):
    got_ids, got_scores = choose(nested, score, **options)
    np.testing.assert_array_equal(got_ids, ids)
    np.testing.assert_allclose(got_scores, scores)


def test_nothing_is_chosen_of_nothing():
    ids, scores = choose_segments(np.zeros((4, 0), np.int32), np.zeros(0), np.zeros(0), 5, 20.0, np.zeros((0, 3)))
    assert ids.shape == scores.shape == (0,)


def best_by_recursion(nested, level, members, weight, score, min_points, max_side, points):
    """Return the score that a segment's subtree reaches (-1: none) and the segments chosen in it, by the definition."""
    mass = weight[members].sum()
    is_usable = mass >= min_points and np.ptp(points[members, :2], axis=0).max() <= max_side
    own = (weight * score)[members].sum() / mass if is_usable else -1.0
    if level + 1 == len(nested):
        return own, [(frozenset(members.tolist()), own)] if is_usable else []
    children = [members[nested[level + 1][members] == k] for k in np.unique(nested[level + 1][members])]
    found = [best_by_recursion(nested, level + 1, c, weight, score, min_points, max_side, points) for c in children]
    usable = [(weight[c].sum(), best) for c, (best, _) in zip(children, found, strict=True) if best >= 0.0]
    total = sum(mass for mass, _ in usable)
    below = sum(mass * best for mass, best in usable) / total if usable else -1.0
    if below > own + 1e-9:
        return below, [segment for _, chosen in found for segment in chosen]
    return own, [(frozenset(members.tolist()), own)] if is_usable else []


@given(st.integers(0, 10**6), st.integers(1, 40), st.integers(1, 4), st.integers(1, 6))
def test_the_choice_is_that_of_the_definition(seed, n, n_levels, min_points):
    rng = np.random.default_rng(seed)
    nested = [rng.integers(0, max(n // 2, 1), n)]  # fine to coarse: segments are merged at random
    for _ in range(n_levels - 1):
        nested.append(rng.integers(0, nested[-1].max() // 2 + 1, nested[-1].max() + 1)[nested[-1]])
    nested = np.array([np.unique(level, return_inverse=True)[1] for level in reversed(nested)], np.int32)
    weight, score = rng.integers(1, 4, n).astype(float), rng.integers(0, 3, n) / 2.0
    points = rng.uniform(0.0, 25.0, (n, 3))
    ids, scores = choose_segments(nested, weight, score, min_points, 20.0, points)
    expected = []
    for root in range(nested[0].max() + 1):
        members = np.flatnonzero(nested[0] == root)
        expected += best_by_recursion(nested, 0, members, weight, score, min_points, 20.0, points)[1]
    assert partition(ids) == {members for members, _ in expected}
    for members, own in expected:
        (k,) = np.unique(ids[list(members)])
        assert scores[k] == pytest.approx(own)
    assert len(scores) == len(expected)
