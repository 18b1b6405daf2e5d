"""The verdict by evidence, and which scans a body moves in."""

import numpy as np
import pytest

from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.judge import LEFT, Past, is_scenery, judge_tracks, lost_hits, moving_now
from automos.objects.terms import Segments, segment_terms
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts

STAMPS = 0.1 * np.arange(20)


def one_track(
    center, n_points=100, moved=1.0, stayed=0.0, scans=None, side=1.0, z=0.0, is_piece=False, is_hidden=False
):
    """A track seen in `scans` (all where not given) at `center` (T, 2), with shares of its points moved and stayed."""
    scans = np.arange(len(center)) if scans is None else np.asarray(scans)
    center = np.column_stack([center, np.broadcast_to(z, len(center))])
    size = np.column_stack([np.broadcast_to(side, len(center)), *np.ones((2, len(center)))])
    table = Tracks(
        np.zeros(len(scans), np.int64), scans, np.zeros(len(scans), np.int64), center, size,
        np.zeros(len(scans)), np.zeros((len(scans), 3)),
    )  # fmt: skip
    counts = n_points * np.stack([np.broadcast_to(share, len(center)) for share in (1.0, moved, stayed)])
    seen = [Detections.of_objects(Boxes.empty(), *np.zeros((3, 0))) for _ in range(20)]
    for i, s in enumerate(scans):
        box = Boxes(center[i : i + 1], size[i : i + 1], np.zeros(1), np.ones(1))
        seen[s] = one = Detections.of_objects(box, *counts[:, i : i + 1])
        one.part_of[:] = 0 if is_piece else -1
        one.hidden[:] = is_hidden
        one.has_stayed[:] = counts[2, i] > counts[1, i]
    return table, seen


def all_of(seen):
    return Segments.of_scans([segment_terms(found) for found in seen])


def judged(table, seen):
    return judge_tracks(table, all_of(seen), STAMPS)


def verdict_on(**track):
    return judged(*one_track(**track)).verdict[0]


def confidence_on(**track):
    verdicts = judged(*one_track(**track))
    return verdicts.confidence[0] if verdicts.is_moving[0] else 1.0 - verdicts.confidence[0]


STRAIGHT = np.column_stack([0.5 * np.arange(20), np.zeros(20)])  # 5 m/s
SHAKING = 0.5 * np.random.default_rng(0).standard_normal((20, 2))
CLIMBING = np.random.default_rng(1).uniform(0.0, 3.0, 20)


@pytest.mark.parametrize(
    ("track", "expected"),
    [
        ({"center": STRAIGHT}, Verdict.MOVING),
        ({"center": STRAIGHT, "moved": 0.6, "stayed": 0.1}, Verdict.MOVING),
        ({"center": 0.05 * STRAIGHT, "moved": 0.01, "stayed": 0.99}, Verdict.STATIC),
        ({"center": STRAIGHT, "moved": 0.0, "stayed": 0.0}, Verdict.MOVING),
        ({"center": SHAKING, "moved": 0.2, "stayed": 0.3, "z": CLIMBING}, Verdict.STATIC),
        ({"center": 0.001 * STRAIGHT, "moved": 0.05, "stayed": 0.9}, Verdict.STATIC),
        ({"center": STRAIGHT[:1]}, Verdict.STATIC),
        ({"center": STRAIGHT, "n_points": 4}, Verdict.MOVING),
        ({"center": STRAIGHT[[0, 4]], "scans": (0, 1)}, Verdict.MOVING),
        ({"center": STRAIGHT, "is_piece": True, "moved": 0.1, "stayed": 0.3}, Verdict.STATIC),
        ({"center": STRAIGHT, "z": 0.2 * np.arange(20)}, Verdict.MOVING),
    ],
    ids=[
        "a car that drives",
        "half of it seen through",
        "most of it hit again, on half a metre",
        "never looked at by others",
        "foliage that shakes",
        "something that stays, and is seen through here and there",
        "seen once",
        "a few points, in every scan",
        "many points in two scans, one after the other",
        "pieces of something",
        "up a ramp",
    ],
)
def test_what_is_seen_through_and_goes_somewhere_moves(track, expected):
    assert verdict_on(**track) == expected


def test_what_keeps_its_foot_is_steady_though_its_roof_is_hidden_now_and_then():
    table, seen = one_track(STRAIGHT, moved=0.2, stayed=0.2)
    plain = judged(table, seen).confidence[0]
    for i, one in enumerate(seen):
        one.boxes.size[:, 2] = 1.0 + i % 2
        one.boxes.center[:, 2] = 0.5 * one.boxes.size[:, 2]
    assert judged(table, seen).confidence[0] == pytest.approx(plain)
    assert confidence_on(center=STRAIGHT, moved=0.2, stayed=0.2, z=CLIMBING) < confidence_on(
        center=STRAIGHT, moved=0.2, stayed=0.2
    )


def test_what_waits_for_long_and_then_leaves_has_moved():
    t = 0.2 * np.arange(100)
    center = np.column_stack([np.where(t > 14.0, 5.0 * (t - 14.0), 0.0), 0.0 * t])
    table = Tracks(
        np.zeros(100, np.int64), np.arange(100), np.zeros(100, np.int64), np.column_stack([center, 0.0 * t]),
        np.ones((100, 3)), 0.0 * t, np.gradient(np.column_stack([center, 0.0 * t]), t, axis=0),
    )  # fmt: skip
    seen = []
    for k in range(100):
        counts = [np.array([n]) for n in ((100.0, 100.0, 0.0) if t[k] > 14.0 else (100.0, 0.0, 100.0))]
        seen.append(
            Detections.of_objects(Boxes(table.center[k : k + 1], np.ones((1, 3)), np.zeros(1), np.ones(1)), *counts)
        )
    verdicts = judge_tracks(table, all_of(seen), t)
    assert verdicts.is_moving[0]
    now = moving_now(table, verdicts, t).p_moving >= 0.5
    assert not now[:65].any()
    assert now[75:].all()


@pytest.mark.parametrize(("scatter", "strolls"), [(0.05, True), (0.15, False), (0.4, False)])
def test_who_strolls_moves_now_if_her_place_is_known_well(scatter, strolls):
    n, t = 40, 0.1 * np.arange(40)
    center = np.stack([0.4 * t, np.zeros(n), np.ones(n)], axis=1)
    velocity = np.tile([0.4, 0.0, 0.0], (n, 1))
    row = np.arange(n)
    table = Tracks(0 * row, row, 0 * row, center, np.ones((n, 3)), np.zeros(n), velocity)
    verdicts = Verdicts(np.array([Verdict.MOVING], np.int8), np.ones(1), np.array([scatter]))
    assert (moving_now(table, verdicts, t).p_moving >= 0.5).all() == strolls


def test_what_has_stayed_in_every_scan_is_scenery():
    (car, seen_car), (wall, seen_wall) = one_track(STRAIGHT), one_track(0.0 * STRAIGHT, moved=0.0, stayed=1.0)
    car = Tracks(car.track + 1, car.scan, car.segment + 1, car.center, car.size, car.yaw, car.velocity)
    seen = [Detections.concatenate([a, b]) for a, b in zip(seen_wall, seen_car, strict=True)]
    both, segments = Tracks.concatenate([wall, car]), all_of(seen)
    assert is_scenery(both, np.array([False, False]), segments).tolist() == [True, False]
    assert is_scenery(both, np.array([True, False]), segments).tolist() == [False, False]


def test_while_more_scans_come_a_way_speaks_for_motion_and_none_says_nothing():
    def so_far(**track):
        tracks, found = one_track(**track, moved=0.02, stayed=0.5)  # which says nothing
        verdicts = judge_tracks(tracks, all_of(found), STAMPS, Past.nothing(1))
        return verdicts.confidence[0] if verdicts.is_moving[0] else 1.0 - verdicts.confidence[0]

    stands, creeps, drives = (so_far(center=speed * STRAIGHT) for speed in (0.0, 0.004, 1.0))
    assert stands == pytest.approx(creeps, abs=0.01)  # what has not gone yet may still go
    assert stands > confidence_on(center=0.0 * STRAIGHT, moved=0.02, stayed=0.5)
    slides = so_far(center=STRAIGHT, is_hidden=True)
    odds = slides / (1.0 - slides) * (1.0 - stands) / stands
    assert np.log(odds) == pytest.approx(-LEFT, abs=0.2)
    assert slides < drives < confidence_on(center=STRAIGHT, moved=0.02, stayed=0.5)


def test_what_a_body_shows_elsewhere_counts_anew():
    departs = np.column_stack([np.maximum(np.arange(20) - 13.0, 0.0), np.zeros(20)])  # 10 m/s
    stood = np.where(np.arange(20) < 14, 0.98, 0.0)

    def said(speed):
        p = [confidence_on(center=speed * departs, moved=left, stayed=stood) for left in (0.0, 0.02 - 0.02 * stood)]
        return np.diff(np.log(p) - np.log1p(-np.array(p)))

    assert said(1.0) > 1.5 * said(0.1) > 0.0


def lost(moved, stayed, sensor=0.0, scans=20, n_points=100, **track):
    """What the last sight, with these shares, says of a thing that stood; the sensor goes so many metres a scan."""
    shares = (np.append(np.full(scans - 1, before), now) for before, now in ((0.0, moved), (0.98, stayed)))
    _, seen = one_track(np.zeros((scans, 2)), n_points, *shares, **track)
    terms = all_of(seen).terms
    terms.sensor[:, 0] = sensor * np.arange(scans)
    return lost_hits(np.array([0, scans]), STAMPS[:scans], terms)[0]


def test_what_is_no_longer_hit_sets_off_and_what_is_hit_as_before_says_nothing():
    assert lost(0.0, 0.98) == lost(0.0, 0.5) == lost(0.01, 0.9) == 0.0
    assert 0.0 < lost(0.08, 0.9) < lost(0.2, 0.5) == lost(0.9, 0.0) == -LEFT


def test_what_is_seen_from_elsewhere_or_is_hardly_known_loses_its_hits_without_setting_off():
    assert lost(0.08, 0.9, sensor=0.2) < lost(0.08, 0.9, sensor=0.05) < lost(0.08, 0.9)
    assert lost(0.2, 0.5, scans=5) == lost(0.2, 0.5, is_piece=True) == lost(0.2, 0.5, n_points=10) == 0.0


def test_only_while_more_scans_come_lost_hits_speak_for_motion():
    shares = np.append(np.full(17, 0.98), [0.5, 0.4, 0.3])
    table, seen = one_track(np.zeros((20, 2)), 100, np.append(np.zeros(17), [0.1, 0.2, 0.3]), shares)
    of_all, so_far = judged(table, seen), judge_tracks(table, all_of(seen), STAMPS, Past.nothing(1))
    assert not of_all.is_moving[0]
    assert so_far.confidence[0] < of_all.confidence[0]


def test_no_tracks_have_no_verdicts():
    assert lost_hits(np.zeros(1, np.int64), np.zeros(0), all_of([]).terms).shape == (0,)
    none = one_track(STRAIGHT)[0][np.zeros(0, np.int64)]
    assert len(judged(none, []).verdict) == 0
