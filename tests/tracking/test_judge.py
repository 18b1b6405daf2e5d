"""The verdict by evidence: what left its place and went somewhere has moved."""

import numpy as np
import pytest

from automos.detections import Detections
from automos.settings import JudgeSettings
from automos.tracking.judge import judge_by_evidence, motion
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdict
from automos.upright_boxes import Boxes

STAMPS = 0.1 * np.arange(20)
FAR_SENSOR = np.tile([0.0, -30.0, 1.7], (20, 1))


def one_track(center, n_points=100, moved=1.0, stayed=0.0, scans=None, side=1.0, climb=0.0, is_piece=False, lift=0.0):
    """A track seen in `scans` (all where not given) at `center` (T, 2), with shares of its points moved and stayed."""
    scans = np.arange(len(center)) if scans is None else np.asarray(scans)
    center = np.column_stack([center, np.linspace(0.0, climb, len(center))])
    size = np.column_stack([np.broadcast_to(side, len(center)), *np.ones((2, len(center)))])
    table = Tracks(
        np.zeros(len(scans), np.int64), scans, np.zeros(len(scans), np.int64), center, size,
        np.zeros(len(scans)), np.zeros((len(scans), 3)),
    )  # fmt: skip
    found = {s: Boxes(center[i : i + 1], size[i : i + 1], np.zeros(1), np.ones(1)) for i, s in enumerate(scans)}
    counts = [np.array([n_points * share]) for share in (1.0, moved, stayed)]
    none = Detections.of_objects(Boxes.empty(), *np.zeros((3, 0)))
    seen = [Detections.of_objects(found[s], *counts) if s in found else none for s in range(20)]
    for at, one in zip(np.broadcast_to(lift, 20), seen, strict=True):
        one.part_of[:] = 0 if is_piece else -1
        one.lift[:] = at
    return table, seen


def verdict_on(sensor=FAR_SENSOR, **track):
    tracks, detections = one_track(**track)
    return judge_by_evidence(tracks, detections, STAMPS, sensor, JudgeSettings()).verdict[0]


STRAIGHT = np.column_stack([0.5 * np.arange(20), np.zeros(20)])  # 5 m/s
SHAKING = 0.5 * np.random.default_rng(0).standard_normal((20, 2))
HERE_AND_THERE = np.column_stack([1.5 * np.sin(0.6 * np.arange(20)), 0.05 * np.arange(20)])


CAR_FIRST_SEEN_IN_PART = np.r_[[0.0, 0.5], 3.0 + 0.1 * np.arange(18)]
"""Its boot alone, then the whole: the middle jumps, backwards or forwards, by more than the car has come."""


@pytest.mark.parametrize(
    ("track", "expected"),
    [
        ({"center": STRAIGHT}, Verdict.MOVING),
        ({"center": STRAIGHT, "moved": 0.6, "stayed": 0.1}, Verdict.MOVING),
        ({"center": STRAIGHT, "moved": 0.3, "stayed": 0.6}, Verdict.STATIC),
        ({"center": SHAKING, "moved": 0.6}, Verdict.STATIC),
        ({"center": 0.01 * STRAIGHT}, Verdict.STATIC),
        ({"center": STRAIGHT[:1]}, Verdict.STATIC),
        ({"center": STRAIGHT, "n_points": 4}, Verdict.MOVING),
        ({"center": STRAIGHT[::4], "n_points": 4, "scans": range(0, 20, 4)}, Verdict.STATIC),
        ({"center": STRAIGHT[::4], "scans": range(0, 20, 4)}, Verdict.MOVING),
        ({"center": STRAIGHT[:4]}, Verdict.MOVING),
        ({"center": STRAIGHT[[0, 4]], "scans": (0, 1)}, Verdict.MOVING),
        ({"center": STRAIGHT[[0, 8]], "scans": (0, 8)}, Verdict.STATIC),
        ({"center": STRAIGHT[:4], "n_points": 15}, Verdict.STATIC),
        ({"center": STRAIGHT[:10], "n_points": 15, "moved": 0.7}, Verdict.STATIC),
        ({"center": STRAIGHT, "n_points": 15, "moved": 0.7}, Verdict.MOVING),
        ({"center": HERE_AND_THERE, "n_points": 30}, Verdict.MOVING),
        ({"center": HERE_AND_THERE, "n_points": 30, "is_piece": True}, Verdict.STATIC),
        ({"center": STRAIGHT, "n_points": 30, "is_piece": True}, Verdict.MOVING),
        ({"center": STRAIGHT, "climb": 8.0}, Verdict.MOVING),
        ({"center": STRAIGHT, "climb": -11.0}, Verdict.STATIC),
        ({"center": np.vstack([0.01 * STRAIGHT[:-1], [[3.0, 3.0]]])}, Verdict.STATIC),
        ({"center": STRAIGHT, "lift": 3.0}, Verdict.STATIC),
        ({"center": STRAIGHT, "lift": np.where(np.arange(20) < 6, 1.5, 3.0)}, Verdict.MOVING),
    ],
    ids=[
        "a car that drives",
        "half of it seen through, but straight",
        "most of it hit again",
        "foliage that shakes",
        "something that stays within a decimetre",
        "seen once",
        "a few points, in every scan",
        "a few points, in every fourth scan",
        "many points, in every fourth scan",
        "many points in a few scans",
        "many points in two scans, one after the other",
        "many points in two scans that are far apart",
        "a glimpse",
        "a longer glimpse, not all of it seen through",
        "the same for long",
        "all of it seen through, here and there",
        "pieces that were, here and there",
        "a piece that drives",
        "up a ramp",
        "down a tree",
        "something that stays, then once something else",
        "a crown of leaves",
        "a lorry whose wheels are hidden mostly",
    ],
)
def test_what_is_seen_through_and_goes_somewhere_moves(track, expected):
    assert verdict_on(**track) == expected


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_piece_seen_first_does_not_hide_the_motion_of_the_whole(direction):
    center = np.column_stack([direction * CAR_FIRST_SEEN_IN_PART, np.zeros(20)])
    side = np.r_[[1.0, 1.0], np.full(18, 4.5)]
    assert verdict_on(center=center, side=side, moved=0.6, stayed=0.3) == Verdict.MOVING
    jumping = center.copy()
    jumping[2:] = center[2]  # and then it stands
    assert verdict_on(center=jumping, side=side, moved=0.6, stayed=0.3) == Verdict.STATIC


SLIDING = 20.0 - np.abs(np.arange(20) - 9.5)
"""Length of what is seen of a long thing through a gap: first more of it comes into sight, then less is left."""


@pytest.mark.parametrize(
    ("track", "expected"),
    [
        ({"side": SLIDING, "moved": 0.6, "stayed": 0.3}, Verdict.MOVING),
        ({"side": SLIDING, "moved": 0.4, "stayed": 0.35}, Verdict.STATIC),
        ({"side": 0.2 * SLIDING, "moved": 0.6, "stayed": 0.3}, Verdict.STATIC),
    ],
    ids=["a tram", "a hedge, half of it seen through", "a bush"],
)
def test_of_something_long_the_evidence_decides_wherever_its_middle_is(track, expected):
    assert verdict_on(center=0.01 * STRAIGHT, **track) == expected


def test_what_rides_along_beside_the_sensor_is_its_own_vehicle():
    sensor = np.column_stack([STRAIGHT, np.full(20, 1.7)])
    beside = {"center": STRAIGHT + np.array([1.0, 1.0])}
    ahead = {"center": STRAIGHT + np.array([12.0, 0.0])}
    assert verdict_on(sensor, **beside) == Verdict.STATIC
    assert verdict_on(sensor, **beside, side=6.0) == Verdict.MOVING  # a lorry in the next lane
    assert verdict_on(sensor, **ahead) == Verdict.MOVING


def test_motion_of_a_straight_line_by_hand():
    # x = 0, 1, 2 m at 0, 1, 2 s: 1 m/s, no scatter; standard error = noise / sqrt(sum (t - 1)^2) = 0.1 / sqrt(2).
    significance, straightness, distance = motion(
        np.array([[0.0, 0], [1, 0], [2, 0]]), np.array([0.0, 1, 2]), JudgeSettings(noise=0.1)
    )
    assert significance == pytest.approx(10 * np.sqrt(2))
    assert (straightness, distance) == (1.0, 2.0)


def test_someone_who_walks_and_then_stands_has_walked_straight():
    stamps = 0.1 * np.arange(100)
    x = np.minimum(1.2 * stamps, 3.0) + 0.15 * np.random.default_rng(0).standard_normal(100)  # his box scatters
    _, straightness, _ = motion(np.column_stack([x, np.zeros(100)]), stamps, JudgeSettings())
    assert straightness > 0.6  # 0.15 over the raw centres


def test_a_way_there_and_back_is_not_straight():
    _, straightness, distance = motion(
        np.array([[0.0, 0], [1, 0], [0, 0]]), np.array([0.0, 1, 2]), JudgeSettings(noise=0.1)
    )
    assert (straightness, distance) == (0.0, 0.0)
