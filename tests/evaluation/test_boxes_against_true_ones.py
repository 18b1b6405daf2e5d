"""Errors of boxes: hand-computed cases, and figures on a real recording with drawn boxes."""

import json

import numpy as np
import pytest

from automos.core.geometry import make_transform
from automos.core.upright_boxes import Boxes, TrueBoxes
from automos.evaluation.boxes import BoxErrors, compare_boxes, tracks_of_boxes, true_velocity
from automos.evaluation.overlaps import NO_TRACK, NOT_MOVING, STANDS, Overlaps

CAR = 1 << 16 | 252


def boxes(*rows):
    """Return boxes of rows x, y, z, length, width, height, yaw."""
    table = np.array(rows, np.float64)
    return Boxes(table[:, :3], table[:, 3:6], table[:, 6], np.ones(len(table)))


def test_overlap_is_seen_from_above_and_heading_is_known_to_half_a_turn():
    true = boxes(*[(0, 0, 0, 4, 2, 1.5, 0.0)] * 4)
    found = boxes(
        (0, 0, 5, 4, 2, 9, np.pi), (1, 0, 0, 4, 2, 1.5, 0), (0, 0, 0, 4, 2, 1.5, np.pi / 2), (9, 0, 0, 4, 2, 1.5, -3)
    )
    iou, length, width, yaw = compare_boxes(found, true)
    np.testing.assert_allclose(iou, [1.0, 6 / 10, 4 / 12, 0.0], atol=1e-9)
    np.testing.assert_allclose(yaw, [0.0, 0.0, 90.0, 180 - np.degrees(3)], atol=1e-9)
    np.testing.assert_array_equal([length, width], 0.0)


def test_of_a_true_box_that_is_wider_than_long_the_longer_side_is_the_length():
    found, across = boxes((0, 0, 0, 4, 2, 1, 0.0)), boxes((0, 0, 0, 2, 4, 1, -np.pi / 2))
    np.testing.assert_allclose(np.concatenate(compare_boxes(found, across)), [1.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_errors_are_the_same_from_wherever_they_are_seen():
    rng = np.random.default_rng(1)
    a, b = (boxes(*rng.normal([0, 0, 0, 5, 4, 3, 0], 0.8, (20, 7))) for _ in range(2))
    T = make_transform([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]], [30.0, -7.0, 2.0])
    for here, there in zip(compare_boxes(a, b), compare_boxes(a.transformed(T), b.transformed(T)), strict=True):
        np.testing.assert_allclose(here, there, atol=1e-9)


def test_the_track_of_a_true_box_is_the_one_with_most_of_its_points_in_that_scan():
    table = Overlaps(
        *np.array(
            [
                *((0, CAR, 3, 12), (0, CAR, 4, 15), (0, CAR, NOT_MOVING, 90), (0, STANDS, 9, 99)),
                *((1, CAR, 3, 29), (2, CAR, NOT_MOVING, 28), (2, CAR, NO_TRACK, 2)),
            ]
        ).T
    )
    scan, mover, track = tracks_of_boxes(table)
    # in scan 1 it has too few points for anyone to draw a box
    np.testing.assert_array_equal([scan, mover, track], [[0, 2], [CAR, CAR], [4, NO_TRACK]])


def test_velocity_is_the_way_between_boxes_some_four_tenths_of_a_second_before_and_after():
    stamps = 0.2 * np.arange(9)
    center = np.column_stack([stamps**2, 3 * stamps, 0 * stamps])
    found = true_velocity(stamps, center)
    np.testing.assert_allclose(found[4], [2 * stamps[4], 3.0, 0.0])
    assert np.isnan(found[[0, -1]]).all()
    assert np.isnan(true_velocity(np.array([0.0, 1.0, 2.0]), np.zeros((3, 3)))).all()  # too far apart


def test_a_box_without_a_track_counts_in_the_shares_alone():
    nothing = np.nan
    errors = BoxErrors(
        np.array([1, 1, 2, 3]),
        *(np.array(column) for column in ([0.8, 0.6, 0.3, nothing], *[[1.0, 3, 8, nothing]] * 4)),
    )
    scores = errors.to_dict()
    assert (scores["boxes"], scores["with_track"], scores["iou_0.4"], scores["iou_0.7"]) == (4, 0.75, 0.5, 0.25)
    assert scores["yaw"] == pytest.approx({"median": 3.0, "worst_tenth": 7.0, "over_movers": 5.0})
    assert scores["iou"]["worst_tenth"] == pytest.approx(np.percentile([0.8, 0.6, 0.3], 10))
    assert BoxErrors.empty().to_dict()["yaw"] == {"median": None, "worst_tenth": None, "over_movers": None}


@pytest.mark.recordings
def test_boxes_drawn_by_people_are_the_truth_of_themselves(recordings):
    drawn = json.loads((recordings / "sequences" / "lyft_5hz" / "boxes.json").read_text())[20]
    rows = [[b[key] for key in ("x", "y", "z", "l", "w", "h", "yaw")] for b in drawn]
    iou, *errors = compare_boxes(boxes(*rows), TrueBoxes(np.arange(len(rows)), boxes(*rows), np.eye(4)).boxes)
    np.testing.assert_allclose(iou, 1.0)
    np.testing.assert_allclose(errors[:2], 0.0)
