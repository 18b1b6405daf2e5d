import numpy as np
import pytest

from automos.core.geometry import inverse, make_transform, se3_exp
from automos.writers.maps.loops.pose_graph import Edges, solve_pose_graph


def along_x(x):
    return np.array([make_transform(t=[v, 0.0, 0.0]) for v in np.atleast_1d(x)])


def chain_of(T, deviation):
    n = len(T) - 1
    return Edges(np.arange(n), np.arange(1, n + 1), inverse(T[:-1]) @ T[1:], np.full((n, 6), deviation))


def links_of(pairs, T, deviation):
    first, second = np.array(pairs).reshape(-1, 2).T
    return Edges(first, second, np.asarray(T).reshape(-1, 4, 4), np.full((len(first), 6), deviation))


def test_a_link_shares_the_error_out_as_the_deviations_say():
    # Five steps of 1 m, a link over all of them that measures 5.5 m, everything 0.3 m off usually. The least squares
    # make all steps 1 + a with  a / 0.3^2 = (0.5 - 5 a) / 0.3^2:  a = 0.5 / 6.
    T = along_x(np.arange(6.0))
    solved, is_kept = solve_pose_graph(T, chain_of(T, 0.3), links_of([(0, 5)], along_x(5.5), 0.3))
    assert is_kept.tolist() == [True]
    # Graduated judging leaves a link that fits at trust (16.8 / (r^2 + 16.8))^2, r = (0.5 - 5 a) / 0.3 in all: 0.97.
    np.testing.assert_allclose(solved[:, 0, 3], np.arange(6.0) * (1.0 + 0.5 / 6.0), atol=0.01)
    np.testing.assert_allclose(solved[:, 1:3, 3], 0.0, atol=1e-9)


def test_a_drifted_circle_closes():
    rng = np.random.default_rng(0)
    step = se3_exp([1.0, 0.0, 0.0, 0.0, 0.0, 2.0 * np.pi / 40.0])
    true, drifted = [np.eye(4)], [np.eye(4)]
    for _ in range(40):
        true.append(true[-1] @ step)
        drifted.append(drifted[-1] @ step @ se3_exp([*rng.normal(0.02, 0.02, 3), *rng.normal(0.004, 0.002, 3)]))
    true, drifted = np.array(true), np.array(drifted)
    assert np.linalg.norm(drifted[-1, :3, 3]) > 1.0
    links = links_of([(0, 40), (1, 40)], [np.eye(4), inverse(true[1])], 0.02)
    solved, is_kept = solve_pose_graph(drifted, chain_of(drifted, 0.1), links)
    assert is_kept.all()
    assert np.linalg.norm(solved[-1, :3, 3]) < 0.05
    middle = slice(5, 35)  # the loop as a whole is the better for it
    before, after = (np.linalg.norm((T - true)[middle, :3, 3], axis=1).mean() for T in (drifted, solved))
    assert after < 0.7 * before


@pytest.mark.parametrize("wrong", [3.0, 30.0])
def test_a_link_that_contradicts_chain_and_links_is_given_up(wrong):
    T = along_x(np.arange(11.0))
    good = [(0, 10), (1, 9), (2, 10)]
    measured = along_x([10.1, 8.1, 8.1, wrong])
    solved, is_kept = solve_pose_graph(T, chain_of(T, 0.1), links_of([*good, (0, 9)], measured, 0.05))
    assert is_kept.tolist() == [True, True, True, False]
    np.testing.assert_allclose(solved[-1, 0, 3], 10.1, atol=0.05)


def test_without_links_the_poses_stay():
    T = along_x(np.arange(4.0))
    solved, is_kept = solve_pose_graph(T, chain_of(T, 0.1), links_of(np.zeros((0, 2), int), np.zeros((0, 4, 4)), 0.1))
    np.testing.assert_array_equal(solved, T)
    assert len(is_kept) == 0


def test_the_world_may_be_turned_without_any_difference():
    T = along_x(np.arange(6.0))
    links = links_of([(0, 5)], along_x(5.3), 0.2)
    turn = se3_exp([3.0, -2.0, 1.0, 0.4, -0.2, 2.0])
    one, other = (solve_pose_graph(W @ T, chain_of(T, 0.2), links)[0] for W in (np.eye(4), turn))
    np.testing.assert_allclose(turn @ one, other, atol=1e-6)
