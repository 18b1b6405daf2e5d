"""The whole of a moving object: what its segment lacks is found beside it, and nothing else."""

import numpy as np

from automos.labels import Label
from automos.settings import CompletionSettings
from automos.tracking.completion import paint_objects
from automos.tracking.tracks import Tracks

GRID = np.stack(np.meshgrid(np.arange(-5, 5, 0.25), np.arange(-4, 4, 0.25)), axis=-1).reshape(-1, 2)


def scene(slope=0.0):
    """Ground, and a box of 4 x 2 m on it whose lowest points, 0.15 m up, were taken for ground."""
    ground = np.column_stack([GRID, slope * GRID[:, 0]])
    body = GRID[(np.abs(GRID[:, 0]) <= 2) & (np.abs(GRID[:, 1]) <= 1)]
    upper = np.column_stack([body, slope * body[:, 0] + 1.0])
    wheels = np.array([[x, y, slope * x + 0.15] for x in (-1.5, 1.5) for y in (-0.9, 0.9)])
    points = np.concatenate([ground, upper, wheels]).astype(np.float32)
    part = np.repeat([0, 1, 2], [len(ground), len(upper), len(wheels)])
    return points, part


def with_labels(tracks):
    """Return the labels that points of these tracks get, and the tracks."""
    return np.where(tracks >= 0, Label.MOVING, Label.STATIC), tracks


def paint(points, part, segment=0, may_move=None, has_stayed=False):
    ids = np.where(part == 1, segment, -1).astype(np.int32)
    none = np.full_like(ids, -1)
    row = Tracks(
        np.array([7]), np.array([0]), np.array([segment]), np.array([[0.0, 0.0, 0.6]]), np.array([[4.0, 2.0, 1.2]]),
        np.zeros(1), np.zeros((1, 3)),
    )  # fmt: skip
    may_move = np.ones(len(points), bool) if may_move is None else may_move
    segments = (none, ids) if has_stayed else (ids, none)
    return with_labels(paint_objects(points, *segments, part != 1, may_move, row, CompletionSettings()))


def test_wheels_taken_for_ground_are_the_objects_and_the_ground_is_not():
    for slope in (0.0, 0.1):
        points, part = scene(slope)
        labels, tracks = paint(points, part)
        assert (labels[part > 0] == Label.MOVING).all()
        assert (labels[part == 0] == Label.STATIC).all()
        assert set(tracks[labels == Label.MOVING]) == {7}


def test_a_segment_that_has_stayed_is_painted_whole_when_a_moving_track_ends_in_it():
    points, part = scene()
    labels, _ = paint(points, part, has_stayed=True)
    assert (labels[part > 0] == Label.MOVING).all()
    assert (labels[part == 0] == Label.STATIC).all()


def test_what_is_known_to_have_stayed_is_left_alone():
    points, part = scene()
    labels, _ = paint(points, part, may_move=part != 2)
    assert (labels[part == 2] == Label.STATIC).all()


def test_a_missed_objects_box_claims_what_stands_in_it():
    points, part = scene()
    ids = np.full(len(points), -1, np.int32)
    row = Tracks(
        np.array([0]), np.array([0]), np.array([-1]), np.array([[0.0, 0.0, 0.6]]), np.array([[4.0, 2.0, 1.2]]),
        np.zeros(1), np.zeros((1, 3)),
    )  # fmt: skip
    found = paint_objects(points, ids, ids, part == 0, np.ones(len(points), bool), row, CompletionSettings())
    labels, _ = with_labels(found)
    assert (labels[part == 1] == Label.MOVING).all()
    assert (labels[part == 0] == Label.STATIC).all()


def test_no_moving_tracks_leave_everything_static():
    points, part = scene()
    ids, boxes = np.zeros(0, np.int64), np.zeros((0, 3))
    none = Tracks(ids, ids, ids, boxes, boxes, np.zeros(0), boxes)
    nowhere = np.full(len(points), -1, np.int32)
    tracks = paint_objects(points, nowhere, nowhere, part == 0, part >= 0, none, CompletionSettings())
    assert (tracks == -1).all()


def test_on_smooth_ground_what_stands_a_few_centimetres_high_is_the_object_and_on_rough_ground_it_is_not():
    points, part = scene()
    points[part == 2, 2] = 0.06
    labels, _ = paint(points, part)
    assert (labels[part == 2] == Label.MOVING).all()
    points[part == 0, 2] += np.random.default_rng(0).normal(0.0, 0.03, (part == 0).sum()).astype(np.float32)
    labels, _ = paint(points, part)
    assert (labels[part == 2] == Label.STATIC).all()
    points[part == 2, 2] = 0.15  # more than any ground's roughness is taken for
    labels, _ = paint(points, part)
    assert (labels[part == 2] == Label.MOVING).all()
