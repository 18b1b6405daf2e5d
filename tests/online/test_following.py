import copy
from dataclasses import replace

import numpy as np
import pytest

from automos import Labeler, load_settings
from automos.core.geometry import make_transform
from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.tracker import Tracker, track_objects, until_last_seen
from automos.objects.tracking import SURE
from automos.objects.tracks import Tracks
from automos.online.following import FEW, MEMORY, Following, Found

SETTINGS = load_settings("default").tracking


def cars(*x: float) -> Detections:
    """Return cars of 100 points, all seen to have moved, in a row."""
    n = len(x)
    boxes = Boxes(
        np.column_stack([x, np.zeros(n), np.ones(n)]), np.tile([4.0, 2.0, 1.5], (n, 1)), np.zeros(n), np.ones(n)
    )
    return Detections.of_objects(boxes, np.full(n, 100.0), np.full(n, 100.0), np.zeros(n))


SCANS = [(0.1 * k, cars(1.0 * k, 40.0 - 0.8 * k)) for k in range(12)]


def test_a_tracker_fed_scan_by_scan_finds_what_one_run_finds():
    tracker = Tracker(SETTINGS)
    fed = until_last_seen(Tracks.concatenate([tracker.step(stamp, found) for stamp, found in SCANS]))
    whole = track_objects(SCANS, SETTINGS)
    assert len(whole) == 2
    for name, column in whole.to_arrays().items():
        np.testing.assert_array_equal(getattr(fed, name), column)


def test_a_copy_goes_its_own_way():
    tracker = Tracker(SETTINGS)
    steps = [tracker.step(stamp, found) for stamp, found in SCANS[:6]]
    other = copy.copy(tracker)
    for k in range(6, 9):  # another future: nothing is seen any more
        other.step(0.1 * k, cars())
    steps += [tracker.step(stamp, found) for stamp, found in SCANS[6:]]
    fed = until_last_seen(Tracks.concatenate(steps))
    for name, column in track_objects(SCANS, SETTINGS).to_arrays().items():
        np.testing.assert_array_equal(getattr(fed, name), column)


def seen(stamp: float, found: Detections, is_far: bool = True, sensor: tuple[float, float] = (0.0, 0.0)) -> Found:
    """Return the segments of a scan taken at `sensor`, metres."""
    return Found(stamp, replace(found, sensor=np.tile(sensor, (len(found), 1))), is_far)


def probability(following: Following, stamp: float, *ahead: Found) -> float:
    """Return with which probability the one car of a scan has moved."""
    verdicts = following.at(stamp, list(ahead)).verdicts
    return float(np.where(verdicts.is_moving, verdicts.confidence, 1.0 - verdicts.confidence)[0])


def seen_to_move(share: float, x: float) -> Detections:
    """Return one car of which some share of the points moved, and the others stayed."""
    counts = np.full(1, 100.0), np.full(1, 100.0 * share), np.full(1, 100.0 * (1.0 - share))
    return Detections.of_objects(cars(x).boxes, *counts)


@pytest.mark.parametrize("is_at_start", [False, True])
def test_what_appears_for_a_moment_moves_only_if_that_is_sure_but_at_the_start_everything_does(is_at_start):
    following, p = Following(SETTINGS, 0.0), []
    if not is_at_start:
        following.add(seen(-0.1, cars()))
    for k in range(8):
        following.add(seen(0.1 * k, seen_to_move(0.26, 0.4 * k)))
        verdicts = following.at(0.1 * k, []).verdicts
        p.append((bool(verdicts.is_moving[0]), probability(following, 0.1 * k)))
    assert 0.5 < p[3][1] < SURE
    assert p[3][0] == is_at_start  # after 0.3 s
    assert p[-1][0]  # after 0.7 s


def test_a_car_is_believed_to_move_more_once_later_scans_saw_its_place_free():
    following = Following(SETTINGS, 0.0)
    for k in range(FEW):
        following.add(seen(0.1 * k, seen_to_move(0.26, 1.0 * k), is_far=False))
    before = probability(following, 0.2)
    for k in range(FEW):
        following.renew(seen(0.1 * k, cars(1.0 * k), is_far=True))
    assert before < probability(following, 0.2) > 0.5


def test_what_is_seen_for_the_first_time_is_not_known_to_move():
    following = Following(SETTINGS, 0.0)
    following.add(seen(0.0, cars(1.0)))
    assert probability(following, 0.0) == 0.0
    following.add(seen(0.1, cars(2.0)))
    assert not following.at(0.1, []).verdicts.is_moving.any()  # nor how the sensor moves
    following.add(seen(0.2, cars(3.0)))
    assert probability(following, 0.2) > 0.5


def test_on_a_path_that_was_wrong_a_parked_car_went_nowhere_and_keeps_its_number():
    following, at = Following(SETTINGS, 0.0), lambda k: -1.0 * k  # while the sensor drives a metre a scan unnoticed
    for k in range(6):
        following.add(seen(0.1 * k, cars(at(k)), sensor=(-20.0, 0.0)))
    before = following.at(0.5, [])
    changes = {0.1 * k: make_transform(np.eye(3), [at(5) - at(k), 0.0, 0.0]) for k in range(6)}
    following.move(changes)
    for k in range(6, 8):
        following.add(seen(0.1 * k, seen_to_move(0.0, at(5)), sensor=(-20.0, 0.0)))
    after = following.at(0.1 * 7, [])
    assert before.here.velocity[0, 0] < -5.0
    assert abs(after.here.velocity[0, 0]) < 0.5
    near_end = after.here.center[0, :2] - [0.5 * after.here.size[0, 0], 0.0]  # nobody has seen the other
    np.testing.assert_allclose(near_end, [at(5) - 2.0, 0.0], atol=0.1)
    assert after.numbers.tolist() == before.numbers.tolist()


@pytest.mark.parametrize(("n_moving", "is_believed"), [(3, True), (10, False)])
def test_at_the_start_hardly_a_quarter_of_all_things_moves(n_moving, is_believed):
    following, n = Following(SETTINGS, 0.0), 30
    is_mover = np.arange(n) < n_moving
    for k in range(8):
        boxes = Boxes.concatenate([cars(20.0 * i + (1.0 * k if i < n_moving else 0.0)).boxes for i in range(n)])
        counts = np.full(n, 100.0), 100.0 * is_mover, 100.0 * ~is_mover
        following.add(seen(0.1 * k, Detections.of_objects(boxes, *counts)))
        if k == 4:
            assert following.at(0.4, []).verdicts.is_moving.any() == is_believed
    assert following.at(0.1 * 7, []).verdicts.is_moving.sum() == n_moving  # by now the speed has been looked for


@pytest.mark.parametrize(
    ("lag", "step"), [(MEMORY + 2.0, 0.5), pytest.param(MEMORY + 0.5, 0.25, marks=pytest.mark.slow)]
)
def test_a_scan_may_wait_for_longer_than_a_track_is_remembered(lag, step):
    noise, labeler = np.random.default_rng(0), Labeler(lag=lag, is_compensated=True, threads=1)
    room = noise.uniform([-9, -9, -1.5], [9, 9, 2.5], (1500, 3))
    n = round(2.0 * lag / step)
    scans = [room + noise.normal(0.0, 0.01, room.shape) for _ in range(n)]
    given = [done for k, scan in enumerate(scans) for done in labeler.push(scan, step * k)]
    assert len(given) == n - round(lag / step)
    assert [done.index for done in given + labeler.finish()] == list(range(n))


def test_a_car_that_stood_for_seconds_is_believed_to_move_within_half_a_metre():
    following, stood = Following(SETTINGS, 0.0), 40
    for k in range(stood):
        boxes = cars(0.0).boxes
        following.add(seen(0.1 * k, Detections.of_objects(boxes, np.full(1, 100.0), np.zeros(1), np.full(1, 100.0))))
    assert probability(following, 0.1 * (stood - 1)) < 0.1
    way = [0.02 * j**2 / 2.0 for j in range(1, 12)]  # metres, at 2 m/s^2
    for j, x in enumerate(way):
        share = 100.0 * min(0.4 + x, 1.0)  # of its points, where it was free before: its front has gone on
        found = Detections.of_objects(cars(x).boxes, np.full(1, 100.0), np.full(1, share), np.full(1, 100.0 - share))
        following.add(seen(0.1 * (stood + j), found))
        if probability(following, 0.1 * (stood + j)) >= 0.5:
            break
    assert x < 0.5


def seconds_of(following: Following, begin: float, share: float, speed: float) -> float:
    """Follow the car for three memories; return with which probability it has moved at the end."""
    for k in range(round(3.0 * MEMORY / 0.2)):
        stamp = begin + 0.2 * k
        following.add(seen(stamp, seen_to_move(share, speed * k * 0.2)))
        p = probability(following, stamp)
    return p


def test_what_has_moved_is_known_to_have_moved_however_long_it_waits():
    following = Following(SETTINGS, 0.0)
    for k in range(30):
        following.add(seen(0.1 * k, seen_to_move(1.0, 0.2 * k - 5.8)))
        following.at(0.1 * k, [])
    assert seconds_of(following, 3.0, 0.0, 0.0) > 0.9


def test_a_doubt_of_a_moment_does_not_stay():
    following, p = Following(SETTINGS, 0.0), []
    for k in range(12):
        following.add(seen(0.1 * k, seen_to_move(0.4, 0.0)))
        p.append(probability(following, 0.1 * k))
    assert max(p) > 0.4
    assert seconds_of(following, 1.2, 0.0, 0.0) < 0.1


def test_what_a_car_shows_of_itself_may_change_while_it_stands_and_it_moves_once_its_rear_does():
    following, rear = Following(SETTINGS, 0.0), 0.0
    p = []
    for k in range(60):
        rear += 0.1 if k < 10 or k >= 50 else 0.0  # metres: it drives, stands, and drives again
        length = 4.0 if k % 3 else 1.0  # its front is seen in two scans of three
        boxes = Boxes(
            np.array([[rear + 0.5 * length, 0.0, 1.0]]), np.array([[length, 2.0, 1.5]]), np.zeros(1), np.ones(1)
        )
        following.add(seen(0.1 * k, Detections.of_objects(boxes, *np.full((2, 1), 300.0), np.zeros(1))))
        here = following.at(0.1 * k, []).here
        p.append(here.p_moving[0] if len(here.track) else 0.0)
    assert max(p[25:50]) < 0.2
    assert p[-1] > 0.5
