"""From objects to points: the whole of a moving object and nothing else, and how certain each label is."""

import numpy as np
import pytest
from worlds import Block, cast, van

from automos.core.array_sequence import ArraySequence
from automos.core.labels import Label
from automos.core.scan import GROUND, OBJECT, Scan
from automos.objects.object_points import paint_objects, point_confidence
from automos.objects.tracks import Tracks, observed
from automos.pipeline import Steps
from automos.settings import CompletionSettings, load_settings

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


def paint_in(points, segments, is_ground, log_odds, rows, is_told_apart=False):
    """The track of each point, of the evidence on which the log-odds are given, one for all or for each."""
    kind = np.where(is_ground, np.uint8(GROUND), np.uint8(OBJECT))
    about = {"kind": kind, "log_odds": np.broadcast_to(log_odds, len(points))}
    found = dict(zip(("ids", "stayed"), segments, strict=True))
    return paint_objects(points, about, found, rows, observed(rows), CompletionSettings(), is_told_apart)


def paint(points, part, segment=0, log_odds=0.0, has_stayed=False, is_told_apart=False):
    ids = np.where(part == 1, segment, -1).astype(np.int32)
    none = np.full_like(ids, -1)
    row = Tracks(
        np.array([7]), np.array([0]), np.array([segment]), np.array([[0.0, 0.0, 0.6]]), np.array([[4.0, 2.0, 1.2]]),
        np.zeros(1), np.zeros((1, 3)),
    )  # fmt: skip
    segments = (none, ids) if has_stayed else (ids, none)
    return with_labels(paint_in(points, segments, part != 1, log_odds, row, is_told_apart))


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
    labels, _ = paint(points, part, log_odds=np.where(part == 2, -1.0, 0.0))
    assert (labels[part == 2] == Label.STATIC).all()


def test_what_stands_in_a_bodys_box_is_of_it_once_it_is_known_what_stands_there_in_other_scans():
    points, part = scene()
    points[part == 2, 2] = 0.3
    log_odds = np.where(part == 2, -1.0, 0.0)
    labels, _ = paint(points, part, log_odds=log_odds, is_told_apart=True)
    assert (labels[part == 2] == Label.MOVING).all()
    points[part == 2, 0] += 2.05 - points[part == 2, 0].max()  # beside it, and known to have stayed
    labels, _ = paint(points, part, log_odds=log_odds, is_told_apart=True)
    assert (labels[(part == 2) & (points[:, 0] > 2.0)] == Label.STATIC).all()


def test_where_most_of_what_is_in_a_box_has_stayed_the_box_is_wrong():
    points, part = scene()
    points[part == 2, 2] = 0.3
    wall = points[part == 1] - np.float32([0.0, 0.0, 0.6])
    points, part = np.concatenate([points, wall, wall]), np.concatenate([part, np.full(2 * len(wall), 2)])
    labels, _ = paint(points, part, log_odds=np.where(part == 2, -1.0, 0.0), is_told_apart=True)
    assert (labels[part == 1] == Label.MOVING).all()
    assert (labels[part == 2] == Label.STATIC).all()


def test_a_missed_objects_box_claims_what_stands_in_it():
    points, part = scene()
    ids = np.full(len(points), -1, np.int32)
    row = Tracks(
        np.array([0]), np.array([0]), np.array([-1]), np.array([[0.0, 0.0, 0.6]]), np.array([[4.0, 2.0, 1.2]]),
        np.zeros(1), np.zeros((1, 3)),
    )  # fmt: skip
    labels, _ = with_labels(paint_in(points, (ids, ids), part == 0, 0.0, row))
    assert (labels[part == 1] == Label.MOVING).all()
    assert (labels[part == 0] == Label.STATIC).all()


def test_no_moving_tracks_leave_everything_static():
    points, part = scene()
    ids, boxes = np.zeros(0, np.int64), np.zeros((0, 3))
    none = Tracks(ids, ids, ids, boxes, boxes, np.zeros(0), boxes)
    nowhere = np.full(len(points), -1, np.int32)
    assert (paint_in(points, (nowhere, nowhere), part == 0, 0.0, none) == -1).all()


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


# ----------------------------------------------------------------------------------------------------------- confidence
TRACKS = np.array([0.7, 0.9])
"""How sure the verdicts on two tracks are."""


@pytest.mark.parametrize(
    ("is_moving", "owner", "log_odds", "kind", "expected"),
    [
        (True, 1, 5.0, OBJECT, 0.9),
        (True, 1, 0.0, GROUND, 0.9),
        (False, 0, 3.0, OBJECT, 0.7),
        (False, 0, 0.0, GROUND, 1.0),
        (False, -1, 0.0, OBJECT, 0.982),
        (False, -1, 2.0, OBJECT, 0.5),
        (False, -1, -3.0, OBJECT, 1.0),
        (False, -1, 0.0, GROUND, 1.0),
    ],
    ids=[
        "on a moving object",
        "a wheel that was taken for ground, on a moving object",
        "on an object that stays",
        "ground",
        "of no object, seen once",
        "of no object, seen through",
        "of no object, hit again",
        "ground beside nothing",
    ],
)
def test_each_kind_of_point_by_hand(is_moving, owner, log_odds, kind, expected):
    found = point_confidence(
        np.array([is_moving]), np.array([owner], np.int32), TRACKS, np.array([log_odds], np.float16),
        np.array([kind], np.uint8),
    )  # fmt: skip
    assert found[0] / 255.0 == pytest.approx(expected, abs=0.003)


def test_without_tracks_everything_is_as_sure_as_its_evidence():
    none, kind = np.full(3, -1, np.int32), np.full(3, OBJECT, np.uint8)
    found = point_confidence(none >= 0, none, np.zeros(0), np.full(3, -4.0, np.float16), kind)
    assert (found == 255).all()


# --------------------------------------------------------------------------------------------------- few scans a second
def roadside(n_scans=14, gap=1.0):
    """Scans of a sensor on a pole beside a road, one a second, and which points are on traffic at 9 to 15 m/s."""
    rng = np.random.default_rng(0)
    azimuth = 2.0 * np.pi * (np.arange(720) + 0.5) / 720
    e, a = (g.ravel() for g in np.meshgrid(np.radians(np.linspace(-25.0, 8.0, 24)), azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    houses = [Block((10.0 * k, side, 3.0), (6.0 + k % 3, 4.0, 6.0)) for k in range(-6, 7) for side in (-16.0, 17.0)]
    static = (*houses, *(van(9.0 * k, 9.5) for k in range(-4, 5)))
    cars = []
    for lane, way in ((-6.0, 1.0), (-3.0, 1.0), (1.0, -1.0), (4.0, -1.0)):
        for start in np.cumsum(rng.uniform(1.5, 5.0, 8)) - 6.0:
            speed = way * rng.uniform(9.0, 15.0)
            cars.append(Block((-60.0 * way - speed * start, lane, 0.8), (4.5, 1.9, 1.5), velocity=(speed, 0.0, 0.0)))
    scans, truth = [], []
    for i in range(n_scans):
        distance, hit = cast((*static, *cars), np.array([0.0, 0.0, 4.0]), rays, gap * i)
        seen = distance < 60.0
        measured = distance[seen] + rng.normal(0.0, 0.02, seen.sum())
        scans.append(Scan((measured[:, None] * rays[seen]).astype(np.float32), stamp=gap * i))
        truth.append(hit[seen] >= len(static))
    return ArraySequence(scans, is_compensated=True), np.concatenate(truth)


def test_at_one_scan_a_second_what_passes_is_told_by_the_evidence_alone():
    sequence, moves = roadside()
    result = Steps(sequence, load_settings(), poses=np.tile(np.eye(4), (len(sequence), 1, 1)), workers=1).found()
    found = np.concatenate([result.stage.load(name, "label")["label"] for name in result.names]) == Label.MOVING
    assert (found & moves).sum() > 0.8 * moves.sum()
    assert (found & moves).sum() > 0.98 * found.sum()
    assert len(result.tracks) == 0
