import numpy as np
import pytest

from automos.core.geometry import make_transform
from automos.core.labels import Label
from automos.core.scan import Scan
from automos.core.upright_boxes import Boxes
from automos.readers.box_truth import DrawnBoxes, judge_boxes, paint_boxes


def judge(centers, period=0.1):
    """Return the label of one track whose centre is at `centers` (T,) metres along x, a box every `period` s."""
    n = len(centers)
    center = np.column_stack([centers, np.zeros((n, 2))])
    labels = judge_boxes(np.zeros(n, int), period * np.arange(n), center)
    assert len(set(labels.tolist())) == 1
    return Label(labels[0])


@pytest.mark.parametrize(
    ("centers", "label"),
    [
        (np.arange(20) * 0.10, Label.MOVING),  # 1 m/s
        (np.arange(20) * 0.03, Label.UNLABELED),  # 0.3 m/s: nobody can tell
        (np.arange(20) * 0.01, Label.STATIC),  # 0.1 m/s: the annotator's hand
        (np.r_[np.zeros(50), np.arange(10) * 0.5, np.full(50, 5.0)], Label.MOVING),  # waits, drives on, stops
        (np.arange(4) * 0.2, Label.MOVING),  # seen for 0.3 s, 0.6 m
        (np.zeros(4), Label.UNLABELED),  # seen for 0.3 s: it may have waited
        (np.zeros(1), Label.UNLABELED),
    ],
)
def test_a_box_moves_if_it_gets_on_by_half_a_metre_within_a_second(centers, label):
    assert judge(centers) == label


def test_boxes_further_apart_than_a_second_are_judged_by_their_speed():
    assert judge(np.arange(5) * 1.2, period=2.0) == Label.MOVING  # 0.6 m/s
    assert judge(np.arange(5) * 0.4, period=2.0) == Label.STATIC  # 0.2 m/s


def test_tracks_are_judged_each_for_itself_in_any_order():
    time = np.tile(0.1 * np.arange(20), 2)
    track = np.repeat([7, 3], 20)
    x = np.where(track == 7, 5.0 * time, 1.0)
    shuffled = np.random.default_rng(0).permutation(40)
    labels = judge_boxes(track[shuffled], time[shuffled], np.column_stack([x, x, x])[shuffled])
    np.testing.assert_array_equal(labels, np.where(track[shuffled] == 7, Label.MOVING, Label.STATIC))
    assert len(judge_boxes(np.zeros(0, int), np.zeros(0), np.zeros((0, 3)))) == 0


def test_points_in_a_movers_box_are_moving_and_those_at_its_border_are_left_out():
    # a box of 4 x 2 x 2 m around (10, 0, 1), another, static, around (0, 10, 1); the sensor is 2 m above the ground
    boxes = Boxes(np.array([[10.0, 0, 1], [0, 10, 1]]), np.tile([4.0, 2, 2], (2, 1)), np.zeros(2), np.ones(2))
    points = np.array(
        [
            [10.0, 0.0, -1.0],  # inside
            [12.2, 0.0, -1.0],  # 20 cm before it
            [12.4, 0.0, -1.0],  # 40 cm before it
            [10.0, 0.0, -1.9],  # inside, 10 cm above the ground
            [0.0, 10.0, -1.0],  # inside the static one
            [0.0, 12.2, -1.0],
            [0.0, 0.0, 0.0],  # no return
            [np.nan, 0.0, 0.0],
        ],
        np.float32,
    )
    T_ground_sensor = make_transform(t=[0, 0, 2.0])
    labels = np.array([Label.MOVING, Label.STATIC], np.uint8)
    drawn = DrawnBoxes(np.zeros(2), np.array([5, 6]), boxes, labels)
    painted = paint_boxes(Scan(points), T_ground_sensor, drawn)
    assert (painted & 0xFFFF).tolist() == [251, 0, 9, 0, 9, 9, 0, 0]
    assert (painted >> 16).tolist() == [5, 0, 0, 5, 6, 0, 0, 0]


def test_objects_that_nobody_can_judge_are_left_out():
    boxes = Boxes(np.array([[10.0, 0, 1]]), np.array([[4.0, 2, 2]]), np.zeros(1), np.ones(1))
    scan = Scan(np.array([[10.0, 0, 1], [20, 0, 1]], np.float32))
    drawn = DrawnBoxes(np.zeros(1), np.array([1]), boxes, np.array([Label.UNLABELED], np.uint8))
    painted = paint_boxes(scan, np.eye(4), drawn)
    assert (painted & 0xFFFF).tolist() == [0, 9]


def test_a_scan_without_boxes_is_static():
    none = DrawnBoxes(np.zeros(0), np.zeros(0, np.int64), Boxes.empty(), np.zeros(0, np.uint8))
    painted = paint_boxes(Scan(np.ones((3, 3), np.float32)), np.eye(4), none)
    assert painted.tolist() == [9, 9, 9]
