import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automos.objects.paper.voxels import group_by_voxel


@given(st.integers(0, 10**6), st.integers(0, 300), st.sampled_from([0.1, 0.5, 2.0]))
def test_groups_are_the_points_of_one_cell_and_their_mean(seed, n, voxel):
    points = np.random.default_rng(seed).normal(0.0, 2.0, (n, 3)).astype(np.float32)
    group, mean = group_by_voxel(points, voxel)
    assert group.shape == (n,)
    if n:
        _, cell = np.unique(np.floor(points / voxel), axis=0, return_inverse=True)
        np.testing.assert_array_equal(group, cell.ravel())  # both in the order of x, y, z
        expected = [points[group == g].astype(np.float64).mean(axis=0) for g in range(len(mean))]
        np.testing.assert_allclose(mean, expected, atol=1e-6)
    assert mean.dtype == np.float32


@pytest.mark.parametrize(("n", "voxel"), [(0, 0.0), (0, 0.1), (5, 0.0)])
def test_without_voxels_every_point_is_its_own_group(n, voxel):
    points = np.random.default_rng(0).normal(size=(n, 3)).astype(np.float32)
    group, mean = group_by_voxel(points, voxel)
    np.testing.assert_array_equal(group, np.arange(n))
    np.testing.assert_array_equal(mean, points)


def test_the_order_of_points_does_not_change_the_groups():
    rng = np.random.default_rng(0)
    points = rng.normal(0.0, 1.0, (500, 3)).astype(np.float32)
    order = rng.permutation(500)
    group, mean = group_by_voxel(points, 0.5)
    shuffled, same = group_by_voxel(points[order], 0.5)
    np.testing.assert_array_equal(shuffled, group[order])
    np.testing.assert_allclose(same, mean, atol=1e-6)
