import numpy as np

from automos.sensor.connected import connected_parts


def test_points_in_neighbouring_voxels_are_one_part_and_others_are_not():
    points = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.0], [2.0, 0.0, 0.0], [2.0, 0.3, 0.3]])
    part, n_parts = connected_parts(points, 0.3)
    assert part.tolist() == [1, 1, 2, 2]
    assert n_parts == 3
    assert connected_parts(points, 2.5)[0].tolist() == [1, 1, 1, 1]


def test_a_voxel_with_few_points_on_surfaces_connects_nothing():
    x = np.array([0.1, 0.4, 0.5, 0.55, 0.58, 0.7, 1.6])
    points, is_solid = np.column_stack([x, 0.0 * x, 0.0 * x]), x == x
    assert connected_parts(points, 0.3, is_solid)[0].tolist() == [1, 1, 1, 1, 1, 1, 2]
    is_solid[[2, 3, 4, 6]] = False  # three of four points of the second voxel, and the last voxel
    assert connected_parts(points, 0.3, is_solid)[0].tolist() == [1, 2, 2, 2, 2, 2, 0]


def test_no_points_are_no_part():
    part, n_parts = connected_parts(np.zeros((0, 3), np.float32), 0.3)
    assert len(part) == 0
    assert n_parts == 1
