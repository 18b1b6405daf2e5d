import numpy as np
import pytest
from sklearn.metrics import jaccard_score, precision_score, recall_score

from automos.evaluation.moving import Counts, count, range_names

# The borders of SemanticKITTI's ids: 0, 1 unlabeled; 9 static, 10 car ... 99; 251 moving, 252 moving car ... 259.
IDS = np.array([0, 1, 2, 8, 9, 10, 40, 99, 100, 250, 251, 252, 254, 259, 260, 65535], np.uint32)


def test_every_pair_of_truth_and_prediction_counts_as_the_benchmark_says():
    # 1 point truth 0, predicted moving: ignored.   2 points static, predicted moving: FD.
    # 3 moving, predicted moving: TD.               4 moving, predicted static: FS.
    # 5 moving, predicted unlabeled: FS.            6 static, predicted unlabeled: nothing.    7 static: nothing.
    truth = np.repeat([0, 9, 251, 252, 254, 40, 50], [1, 2, 3, 4, 5, 6, 7])
    prediction = np.repeat([251, 251, 251, 9, 0, 0, 9], [1, 2, 3, 4, 5, 6, 7])
    scores = count(prediction, truth).scores
    assert (scores.true_dynamic, scores.false_dynamic, scores.false_static) == (3, 2, 9)
    assert (scores.n_points, scores.n_unlabeled) == (27, 11)
    assert scores.iou == pytest.approx(3 / 14)
    assert scores.precision == pytest.approx(3 / 5)
    assert scores.recall == pytest.approx(3 / 12)


def test_instance_ids_in_the_upper_bits_do_not_matter():
    truth, prediction = np.array([251, 9], np.uint32), np.array([251, 251], np.uint32)
    shifted = count(prediction + np.uint32(7 << 16), truth + np.uint32(0xFFFF << 16))
    np.testing.assert_array_equal(shifted.confusion, count(prediction, truth).confusion)


@pytest.mark.parametrize("seed", range(4))
def test_the_scores_are_those_of_scikit_learn(seed):
    truth, prediction = np.random.default_rng(seed).choice(IDS, (2, 200 * 10**seed))
    is_labelled = np.isin(truth, [9, 10, 40, 99, 251, 252, 254, 259])
    is_true = np.isin(truth, [251, 252, 254, 259])[is_labelled]
    is_predicted = np.isin(prediction, [251, 252, 254, 259])[is_labelled]
    scores = count(prediction, truth).scores
    assert scores.iou == pytest.approx(jaccard_score(is_true, is_predicted), abs=1e-15)
    assert scores.precision == pytest.approx(precision_score(is_true, is_predicted), abs=1e-15)
    assert scores.recall == pytest.approx(recall_score(is_true, is_predicted), abs=1e-15)


def benchmark_iou(prediction, truth):
    """IoU as the benchmark's numpy code has it: a matrix [prediction, truth], ignored truth's columns set to zero."""
    classes = np.zeros(1 << 16, int)
    classes[9:100] = 1
    classes[251:260] = 2
    matrix = np.zeros((3, 3))
    np.add.at(matrix, (classes[prediction & 0xFFFF], classes[truth & 0xFFFF]), 1)
    matrix[:, 0] = 0
    true_positive = matrix[2, 2]
    false_positive = matrix[2, :].sum() - true_positive
    false_negative = matrix[:, 2].sum() - true_positive
    return true_positive / (true_positive + false_positive + false_negative)


def test_the_iou_is_that_of_the_benchmarks_matrix():
    rng = np.random.default_rng(0)
    truth, prediction = rng.choice(IDS, 5000), rng.choice(IDS, 5000)
    assert count(prediction, truth).scores.iou == pytest.approx(benchmark_iou(prediction, truth), abs=1e-12)


def test_scans_are_pooled_by_points_and_not_averaged():
    # 1 of 1 found in the first scan, 0 of 9 in the second: 0.1, where the mean over scans would be 0.5.
    total = count([251], [251]) + count([9] * 9, [251] * 9)
    assert total.scores.iou == pytest.approx(0.1)
    assert total.n_scans == 2


def test_counts_start_at_nothing():
    empty = Counts() + count([], [])
    assert empty.scores.n_points == 0
    assert np.isnan([empty.scores.iou, empty.scores.precision, empty.scores.recall]).all()


def test_nothing_moves_and_nothing_was_called_moving_is_no_number():
    assert np.isnan(count([9, 9, 0], [9, 9, 9]).scores.iou)
    assert count([251], [9]).scores.iou == 0.0


def test_points_fall_into_ranges_whose_lower_end_belongs_to_them():
    ranges = np.array([0.0, 14.999, 15.0, 29.999, 30.0, 49.999, 50.0, 200.0, np.nan, np.inf])
    counts = count(np.full(10, 251), np.full(10, 251), ranges)
    found = {name: scores.true_dynamic for name, scores in counts.scores_by_range.items()}
    assert found == {"0-15 m": 2, "15-30 m": 2, "30-50 m": 2, "50+ m": 2}
    assert list(found) == range_names()
    assert counts.scores.true_dynamic == 10


def test_points_without_a_range_count_in_the_total_only():
    counts = count([251, 9], [251, 251])
    assert counts.scores.n_points == 2
    assert sum(scores.n_points for scores in counts.scores_by_range.values()) == 0


@pytest.mark.parametrize(("prediction", "truth", "ranges"), [([9], [9, 9], None), ([9, 9], [9, 9], [1.0])])
def test_arrays_of_different_length_are_refused(prediction, truth, ranges):
    with pytest.raises(ValueError, match="must be"):
        count(prediction, truth, ranges)
