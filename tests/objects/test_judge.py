"""The verdict by evidence: what left its place and went somewhere has moved."""

import numpy as np
import pytest
from scipy.special import gammaln

from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.judge import (
    LEAST_SOLID,
    LOOKS,
    MISJUDGED,
    MOVED,
    PRIOR,
    STAYED,
    UNDER_WAY,
    WEIGHTS,
    judge_tracks,
    segment_terms,
    track_terms,
    without_scenery,
)
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.settings import JudgeSettings


def one_track(center, n_points=100, moved=1.0, stayed=0.0, scans=None, side=1.0, z=0.0, is_piece=False):
    """A track seen in `scans` (all where not given) at `center` (T, 2), with shares of its points moved and stayed."""
    scans = np.arange(len(center)) if scans is None else np.asarray(scans)
    center = np.column_stack([center, np.broadcast_to(z, len(center))])
    size = np.column_stack([np.broadcast_to(side, len(center)), *np.ones((2, len(center)))])
    table = Tracks(
        np.zeros(len(scans), np.int64), scans, np.zeros(len(scans), np.int64), center, size,
        np.zeros(len(scans)), np.zeros((len(scans), 3)),
    )  # fmt: skip
    found = {s: Boxes(center[i : i + 1], size[i : i + 1], np.zeros(1), np.ones(1)) for i, s in enumerate(scans)}
    counts = [np.array([n_points * share]) for share in (1.0, moved, stayed)]
    none = Detections.of_objects(Boxes.empty(), *np.zeros((3, 0)))
    seen = [Detections.of_objects(found[s], *counts) if s in found else none for s in range(20)]
    for one in seen:
        one.part_of[:] = 0 if is_piece else -1
        one.has_stayed[:] = stayed > moved
    return table, seen


def judged(table, seen, **settings):
    return judge_tracks(table, [segment_terms(found) for found in seen], JudgeSettings(**settings))


def verdict_on(**track):
    return judged(*one_track(**track)).verdict[0]


def terms_of_tracks(table, seen):
    return track_terms(table, [segment_terms(found) for found in seen])


def terms_of(**track):
    return dict(zip(WEIGHTS, terms_of_tracks(*one_track(**track))[0], strict=True))


STRAIGHT = np.column_stack([0.5 * np.arange(20), np.zeros(20)])  # 5 m/s
SHAKING = 0.5 * np.random.default_rng(0).standard_normal((20, 2))
CLIMBING = np.random.default_rng(1).uniform(0.0, 3.0, 20)


@pytest.mark.parametrize(
    ("track", "expected"),
    [
        ({"center": STRAIGHT}, Verdict.MOVING),
        ({"center": STRAIGHT, "moved": 0.6, "stayed": 0.1}, Verdict.MOVING),
        ({"center": STRAIGHT, "moved": 0.01, "stayed": 0.99}, Verdict.STATIC),
        ({"center": STRAIGHT, "moved": 0.0, "stayed": 0.0}, Verdict.STATIC),
        ({"center": SHAKING, "moved": 0.2, "stayed": 0.3, "z": CLIMBING}, Verdict.STATIC),
        ({"center": 0.001 * STRAIGHT, "moved": 0.1, "stayed": 0.8}, Verdict.STATIC),
        ({"center": STRAIGHT[:1]}, Verdict.STATIC),
        ({"center": STRAIGHT, "n_points": 4}, Verdict.MOVING),
        ({"center": STRAIGHT[[0, 4]], "scans": (0, 1)}, Verdict.MOVING),
        ({"center": STRAIGHT, "is_piece": True, "moved": 0.1, "stayed": 0.3}, Verdict.STATIC),
        ({"center": STRAIGHT, "z": 0.2 * np.arange(20)}, Verdict.MOVING),
    ],
    ids=[
        "a car that drives",
        "half of it seen through",
        "most of it hit again",
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


def test_what_nothing_is_known_of_yet_is_static_until_others_speak_of_a_point():
    def verdict(moved):
        table, seen = one_track(center=STRAIGHT[:2], moved=moved, scans=range(2))
        return judge_tracks(table, [segment_terms(found, is_asked=False) for found in seen], JudgeSettings()).verdict[0]

    assert verdict(0.0) == Verdict.STATIC
    assert verdict(0.5) == Verdict.MOVING


def test_the_log_odds_are_the_sum_of_weighted_terms_and_the_confidence_their_probability():
    track = {"center": 0.02 * STRAIGHT, "moved": 0.1, "stayed": 0.5}
    log_odds = PRIOR + sum(WEIGHTS[name] * value for name, value in terms_of(**track).items())
    moves = 1.0 / (1.0 + np.exp(-log_odds))
    for threshold, verdict, confidence in ((0.9 * moves, Verdict.MOVING, moves), (0.99, Verdict.STATIC, 1.0 - moves)):
        found = judged(*one_track(**track), min_probability=threshold)
        assert found.verdict[0] == verdict
        assert found.confidence[0] == pytest.approx(confidence)


def test_the_evidence_of_a_scan_by_hand():
    def likelihood(prior):
        a, n = np.array(prior), np.array([30.0, 50.0, 20.0])
        return gammaln(a.sum()) - gammaln(a.sum() + n.sum()) + (gammaln(a + n) - gammaln(a)).sum()

    ratio = np.exp(likelihood(MOVED) - likelihood(STAYED))
    found = terms_of(center=STRAIGHT, moved=0.3, stayed=0.5)["evidence"]
    scan = UNDER_WAY * ratio + 1.0 - UNDER_WAY
    assert found == pytest.approx(-np.log((1.0 - MISJUDGED) * scan**-LOOKS + MISJUDGED))


def test_all_evidence_of_one_place_is_worth_no_more_than_the_odds_of_its_being_misjudged():
    assert terms_of(center=STRAIGHT, n_points=10_000)["evidence"] < -np.log(MISJUDGED)
    wrong_poses = {"center": SHAKING, "is_piece": True, "moved": 0.7}
    assert verdict_on(**wrong_poses) == Verdict.STATIC


def test_many_points_of_one_scan_say_little_more_than_some_and_a_scan_can_hardly_speak_against():
    some, many = (terms_of(center=STRAIGHT, n_points=n)["evidence"] for n in (100, 10_000))
    assert 0.0 < many - some < some
    assert terms_of(center=STRAIGHT, moved=0.0, stayed=1.0, n_points=10_000)["evidence"] > LOOKS * np.log(
        1.0 - UNDER_WAY
    )


def test_both_faces_must_go_the_same_way():
    growing = np.linspace(1.0, 9.0, 20)  # more and more of it comes into sight: one face stands
    assert terms_of(center=np.column_stack([0.5 * growing, np.zeros(20)]), side=growing)["displacement"] == 0.0
    assert terms_of(center=0.0 * STRAIGHT, side=growing)["displacement"] == 0.0
    assert terms_of(center=STRAIGHT)["displacement"] > 5.0


def test_one_observation_of_something_else_at_an_end_is_no_way():
    center = np.vstack([0.0 * STRAIGHT[:-1], [[3.0, 3.0]]])
    assert terms_of(center=center)["displacement"] == 0.0


def test_what_keeps_its_foot_is_steady_though_its_roof_is_hidden_now_and_then():
    table, seen = one_track(STRAIGHT)
    for i, one in enumerate(seen):
        one.boxes.size[:, 2] = 1.0 + i % 2
        one.boxes.center[:, 2] = 0.5 * one.boxes.size[:, 2]
    assert terms_of_tracks(table, seen)[0, list(WEIGHTS).index("unsteady")] == 0.0
    assert terms_of(center=STRAIGHT, z=CLIMBING)["unsteady"] > 1.0


def test_what_lets_through_the_rays_that_meet_it_is_porous():
    table, seen = one_track(STRAIGHT, n_points=100)
    share_of_a_face = 1.0 - 1.5 / 10.0 + 0.5 / 100.0
    cases = (1.0, 0.0), (share_of_a_face, 0.0), (0.5 * share_of_a_face, 1.0), (0.0, 1.0 / LEAST_SOLID)
    for solidity, through in cases:
        for one in seen:
            one.solidity[:] = solidity
        assert terms_of_tracks(table, seen)[0, list(WEIGHTS).index("porous")] == pytest.approx(through, abs=1e-9)


def test_what_has_stayed_in_every_scan_is_scenery_and_tracks_are_numbered_anew():
    (car, seen_car), (wall, seen_wall) = one_track(STRAIGHT), one_track(0.0 * STRAIGHT, moved=0.0, stayed=1.0)
    wall = Tracks(wall.track, wall.scan, wall.segment, wall.center, wall.size, wall.yaw, wall.velocity)
    car = Tracks(car.track + 1, car.scan, car.segment + 1, car.center, car.size, car.yaw, car.velocity)
    seen = [Detections.concatenate([a, b]) for a, b in zip(seen_wall, seen_car, strict=True)]
    verdicts = Verdicts(np.array([Verdict.STATIC, Verdict.MOVING], np.int8), np.array([0.9, 0.8]))
    kept, left = without_scenery(Tracks.concatenate([wall, car]), verdicts, seen)
    assert len(kept) == len(left.verdict) == 1
    assert set(kept.segment) == {1}
    assert left.confidence.tolist() == [0.8]


def test_no_tracks_have_no_verdicts():
    none = one_track(STRAIGHT)[0][np.zeros(0, np.int64)]
    assert len(judged(none, []).verdict) == 0
