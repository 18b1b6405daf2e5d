import numpy as np

from automos.evaluation.objects import ObjectCounts, count_objects


def label(instance, semantic):
    return np.uint32(instance << 16 | semantic)


def test_each_moving_object_has_its_own_recall():
    truth = np.repeat([label(1, 252), label(2, 254), label(3, 10), label(0, 251)], [4, 2, 5, 3])
    prediction = np.array([251, 251, 251, 9] + [0, 251] + [251] * 8)
    objects = count_objects(prediction, truth)
    # the parked car (10) and the moving points without instance are not moving objects
    np.testing.assert_array_equal(objects.instance, [1, 2])
    np.testing.assert_array_equal(objects.n_points, [4, 2])
    np.testing.assert_array_equal(objects.recall, [0.75, 0.5])


def test_counts_of_an_object_add_up_over_scans():
    first = count_objects([251, 9], [label(5, 252), label(7, 252)])
    second = count_objects([251, 251, 9], [label(7, 252)] * 3)
    total = ObjectCounts() + first + second
    np.testing.assert_array_equal(total.instance, [5, 7])
    np.testing.assert_array_equal(total.n_points, [1, 4])
    np.testing.assert_array_equal(total.n_found, [1, 2])
    np.testing.assert_array_equal(total.n_scans, [1, 2])


def test_objects_of_different_classes_may_share_an_instance_id():
    objects = count_objects([251, 9], [label(1, 252), label(1, 254)])
    np.testing.assert_array_equal(objects.recall, [1.0, 0.0])


def test_a_scan_without_moving_objects_has_none():
    assert len(count_objects([9, 251], [9, 0])) == 0
