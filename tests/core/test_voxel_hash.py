import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automos.core.voxel_map import VoxelMap


def test_voxels_are_numbered_as_they_appear_and_hold_the_mean_of_their_points():
    voxels = VoxelMap(1.0)
    np.testing.assert_array_equal(voxels.add(np.array([[5.2, 0.5, 0.5], [0.1, 0.1, 0.1], [5.4, 0.7, 0.5]])), [0, 1, 0])
    np.testing.assert_array_equal(voxels.add(np.array([[0.3, 0.5, 0.3], [-0.1, 0.1, 0.1]])), [1, 2])
    assert len(voxels) == 3
    np.testing.assert_allclose(voxels.mean, [[5.3, 0.6, 0.5], [0.2, 0.3, 0.2], [-0.1, 0.1, 0.1]], atol=1e-6)


def test_a_voxel_holds_its_lower_border_and_not_its_upper():
    ids = VoxelMap(0.5).add(
        np.array([[0.0, 0, 0], [0.49, 0, 0], [0.5, 0, 0], [-0.01, 0, 0], [-0.5, 0, 0], [-0.51, 0, 0]])
    )
    np.testing.assert_array_equal(ids, [0, 0, 1, 2, 2, 3])


@given(st.integers(0, 10**6), st.sampled_from([0.05, 0.2, 1.0]), st.sampled_from([0.0, 1e4]))
def test_points_share_a_voxel_where_their_cells_are_the_same(seed, voxel, far):
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-1.0, 1.0, 3) + far
    parts = [rng.normal(far, 3.0, (n, 3)) for n in (200, 0, 300)]
    voxels = VoxelMap(voxel, origin)
    ids = np.concatenate([voxels.add(part) for part in parts])
    points = np.concatenate(parts)
    _, cell = np.unique(np.floor((points - origin) * (1.0 / voxel)), axis=0, return_inverse=True)
    # the same partition: each voxel is one cell and each cell one voxel
    assert len(voxels) == len(np.unique(cell)) == len(np.unique(np.column_stack([cell.ravel(), ids]), axis=0))
    # means are float32: 0.5 mm at 10 km
    mean = np.array([points[ids == k].mean(axis=0) for k in range(len(voxels))])
    np.testing.assert_allclose(voxels.mean, mean, atol=1e-6 if far == 0.0 else 1e-3)


def test_a_map_that_grows_past_its_tables_forgets_nothing():
    # 300 000 voxels: the table of keys grows twice and the sums several times
    rng = np.random.default_rng(0)
    cells = np.stack(np.meshgrid(np.arange(100), np.arange(100), np.arange(30), indexing="ij"), -1).reshape(-1, 3)
    cells = cells[rng.permutation(len(cells))]
    voxels = VoxelMap(0.2)
    first = np.concatenate([voxels.add(part) for part in np.array_split(0.2 * cells + 0.1, 7)])
    np.testing.assert_array_equal(first, np.arange(len(cells)))
    np.testing.assert_array_equal(voxels.add(0.2 * cells + 0.12), first)
    np.testing.assert_allclose(voxels.mean, 0.2 * cells + 0.11, atol=1e-5)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_no_points_make_no_voxels(dtype):
    voxels = VoxelMap(0.2)
    assert voxels.add(np.zeros((0, 3), dtype)).shape == (0,)
    assert voxels.mean.shape == (0, 3)
