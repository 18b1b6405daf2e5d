"""Boxes of a run against true ones in a frame of their own."""

import numpy as np
import pytest
from made_run import CENTERS, SIZE, VELOCITY, YAW, make_run

from automos.core.geometry import make_transform, transform
from automos.core.upright_boxes import Boxes, TrueBoxes
from automos.evaluation.overlaps import NO_TRACK, NOT_MOVING, Overlaps
from automos.results.box_scores import box_errors, score_boxes

CAR = 5 << 16 | 252
TURN = 0.7


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Give a run whose moving track is 1 m off along x, and turned by 0.2 rad."""
    run = make_run(tmp_path / "run")
    c, s = np.cos(TURN), np.sin(TURN)
    T_boxes_level = make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [10.0, 20.0, 3.0])

    def truth_boxes(index):
        center = transform(T_boxes_level, np.add([CENTERS[2, index]], [1.0, 0.0, 0.0]))
        box = Boxes(center, np.array([SIZE]), np.array([YAW[2] + TURN + 0.2]), np.ones(1))
        return TrueBoxes(np.array([5]), box, T_boxes_level @ run.T_level_sensor(index))

    monkeypatch.setattr(run.sequence, "truth_boxes", truth_boxes)
    return run


def overlaps(track, n_points=40):
    return Overlaps(np.arange(3), np.full(3, CAR), np.full(3, track), np.full(3, n_points))


def test_boxes_are_compared_in_the_frame_of_the_truth(run):
    errors = box_errors(run, overlaps(2))
    assert len(errors) == 3
    np.testing.assert_allclose(errors.yaw, np.degrees(0.2), atol=0.06)  # files round to a thousandth
    np.testing.assert_allclose([errors.length, errors.width], 0.0, atol=1e-6)
    assert ((errors.iou > 0.45) & (errors.iou < 0.6)).all()  # 1 m of 4 is 0.6 without the turn
    # only the middle scan has a box before and one after: VELOCITY is what the true boxes do, too
    np.testing.assert_allclose(errors.velocity, [np.nan, 0.0, np.nan], atol=1e-2)
    assert VELOCITY == [5.0, 0.0, 0.0]


@pytest.mark.parametrize("track", [NO_TRACK, NOT_MOVING, 77])
def test_a_true_box_without_a_box_of_ours_is_a_row_without_errors(run, track):
    errors = box_errors(run, overlaps(track))
    assert len(errors) == 3
    assert np.isnan([errors.iou, errors.yaw, errors.velocity]).all()


def test_a_mover_with_few_points_has_no_row_and_labels_alone_no_scores(run, tmp_path):
    assert len(box_errors(run, overlaps(2, 29))) == 0
    assert score_boxes(tmp_path, {run.sequence: overlaps(2)}) is None
    assert len(score_boxes(run.folder, {run.sequence: overlaps(2)})) == 3
