import numpy as np

from automos.core.voxel_map import rows_of_first_in_voxel
from automos.odometry.surfels import make_surfels

RNG = np.random.default_rng(0)


def test_a_surfel_is_the_mean_and_covariance_of_the_points_in_its_voxel():
    points = RNG.uniform([2.1, 0.1, 0.1], [2.3, 0.3, 0.3], (50, 3)).astype(np.float32)  # in one voxel of 0.4 m
    times = RNG.uniform(0.1, 0.5, 50).astype(np.float32)
    surfels = make_surfels(points, times)
    assert len(surfels) == 1
    np.testing.assert_allclose(surfels.mean[0], points.mean(axis=0), atol=1e-5)
    expected = np.cov(points.T.astype(float), bias=True)
    np.testing.assert_allclose(surfels.covariance[0], expected[np.triu_indices(3)], atol=1e-6)
    assert surfels.count[0] == 50
    np.testing.assert_allclose(surfels.time[0], times.mean(), atol=1e-6)


def test_a_surfel_has_the_mean_time_of_its_points_whether_they_were_measured_together_or_not():
    points = RNG.uniform([2.1, 0.1, 0.1], [2.3, 0.3, 0.3], (50, 3)).astype(np.float32)
    surfels = make_surfels(points, np.repeat([-0.4, 0.2], 25).astype(np.float32))
    np.testing.assert_allclose(surfels.time, [-0.1], atol=1e-6)


def test_what_a_rotating_sensor_saw_first_and_last_lies_apart():
    points = RNG.uniform([2.1, 0.1, 0.1], [2.3, 0.3, 0.3], (50, 3)).astype(np.float32)
    surfels = make_surfels(points, np.repeat([-0.4, 0.4], 25).astype(np.float32), has_seam=True)
    np.testing.assert_allclose(sorted(surfels.time), [-0.4, 0.4], atol=1e-6)


def test_every_point_is_in_exactly_one_surfel():
    points = RNG.uniform(-90, 90, (5000, 3)).astype(np.float32)
    surfels = make_surfels(points, None)
    assert surfels.count.sum() == len(points)


def test_voxels_double_with_distance():
    pair = np.array([[0.05, 0.0, 0.1], [0.45, 0.0, 0.1]], np.float32)  # 0.4 m apart
    near, far = pair + np.array([2.0, 0, 0]), pair + np.array([24.0, 0, 0])
    assert len(make_surfels(near.astype(np.float32), None)) == 2
    assert len(make_surfels(far.astype(np.float32), None)) == 1


def test_no_points_make_no_surfels():
    assert len(make_surfels(np.zeros((0, 3), np.float32), None)) == 0


def test_the_first_point_of_each_voxel_is_kept():
    points = RNG.uniform(-3, 3, (500, 3)).astype(np.float32)
    _, expected = np.unique(np.floor(points), axis=0, return_index=True)
    np.testing.assert_array_equal(rows_of_first_in_voxel(points, 1.0), np.sort(expected))
    assert len(rows_of_first_in_voxel(points[:0], 1.0)) == 0
