"""Moving objects are followed to where they wait, and nothing that was there before is taken for them."""

import numpy as np
import pytest

from automos.detections import Detections
from automos.settings import ExtensionSettings, FollowSettings
from automos.tracking.extension import extend_tracks
from automos.tracking.follow import follow_objects
from automos.upright_boxes import Boxes

CAR, POLE, PERSON = (4.0, 1.8, 1.5), (0.4, 0.4, 1.7), (0.6, 0.5, 1.7)


def seen(*things):
    """Segments at (x, y, size, whether they have stayed), those that move first; a fifth word: a part of the last."""
    things = sorted(things, key=lambda thing: thing[3])
    center = np.array([[x, y, 0.5 * size[2]] for x, y, size, *_ in things]).reshape(-1, 3)
    size = np.array([thing[2] for thing in things]).reshape(-1, 3)
    has_stayed = np.array([thing[3] for thing in things], bool)
    n = np.full(len(things), 60.0)
    boxes = Boxes(center, size, np.zeros(len(n)), np.ones(len(n)))
    part_of = np.array([len(things) - 1 if len(thing) > 4 else -1 for thing in things], np.int32)
    moved, static = np.where(has_stayed, 0.0, n), np.where(has_stayed, n, 0.0)
    return Detections(boxes, n, moved, static, has_stayed, part_of, np.zeros(len(n)))


def extended(scans, period=0.1):
    """The scans in which each track that moves is seen, before and after, and where it is in the end."""
    stamps = period * np.arange(len(scans))
    tracks = follow_objects(zip(stamps, scans, strict=True), FollowSettings())
    return tracks, extend_tracks(tracks, scans, stamps, ExtensionSettings())


def stops(speed=6.0, brakes_from=20, n=60, size=CAR):
    """(x, has stayed) of something that drives, brakes at 3 m/s^2 and waits; the evidence ends a second later."""
    x, v, way = 0.0, speed, []
    for i in range(n):
        v = max(v - 0.3, 0.0) if i >= brakes_from else v
        x += 0.1 * v
        way.append(x)
    still_from = brakes_from + int(np.ceil(speed / 0.3)) + 10
    return [(x, 0.0, size, i >= still_from) for i, x in enumerate(way)]


@pytest.mark.parametrize("is_reversed", [False, True], ids=["drives, then waits", "waits, then drives"])
def test_a_car_is_moving_while_it_waits(is_reversed):
    way = stops()[:: -1 if is_reversed else 1]
    before, after = extended([seen(thing) for thing in way])
    assert len(before) == len(after) == 1
    assert len(before.scan) < 60
    assert after.scan.tolist() == list(range(60))


def test_the_rate_of_the_sensor_does_not_matter():
    for step in (1, 2, 3):
        scans = [seen(thing) for thing in stops()[::step]]
        assert len(extended(scans, 0.1 * step)[1].scan) == len(scans)


def test_someone_who_walks_out_of_sight_at_a_pole_is_not_the_pole():
    pole = (4.3, 0.2, POLE, True)
    walker = [(0.14 * i, 0.0, PERSON, False) for i in range(30)]
    scans = [seen(walker[i], pole) if i < 30 else seen(pole) for i in range(60)]
    before, after = extended(scans)
    assert after.scan.max() == before.scan.max() == 29


def test_a_fast_car_out_of_sight_does_not_become_a_parked_one():
    parked = (16.0, 0.5, CAR, True)
    scans = [seen((0.6 * i, 0.0, CAR, False)) if i < 22 else seen() if i < 27 else seen(parked) for i in range(60)]
    assert extended(scans)[1].scan.max() == 21


@pytest.mark.parametrize("hidden", [0, 3], ids=["in sight", "out of sight for three scans"])
def test_a_tram_of_which_more_or_less_is_seen_is_followed_on(hidden):
    length = 18.0 + 4.0 * np.random.default_rng(3).random(50)  # m; its front is seen, its end is now and then
    scans = [seen((8.0 * i / 10 - 0.5 * side, 0.0, (side, 2.4, 3.3), i >= 20)) for i, side in enumerate(length)]
    scans[24 : 24 + hidden] = [seen()] * hidden
    before, after = extended(scans)
    assert len(before) == 1
    assert sorted(set(range(50)) - set(after.scan.tolist())) == list(range(24, 24 + hidden))


def test_a_car_that_waits_behind_others_is_known_again_when_they_have_passed():
    scans = [seen(thing) for thing in stops()]
    for scan in scans:
        scan.n_points[:] = 180.0
    for i, n, height in zip(range(45, 50), (60.0, 20.0, 14.0, 14.0, 14.0), (1.2, 0.8, 0.6, 0.6, 0.6), strict=True):
        scans[i] = seen((stops()[i][0], 0.0, (4.0, 1.8, height), True))  # less and less of it, from above
        scans[i].boxes.center[:, 2] = 1.5 - 0.5 * height
        scans[i].n_points[:] = n
    before, after = extended(scans)
    assert len(before) == 1
    assert set(range(60)) - set(after.scan.tolist()) <= set(range(45, 50))


def test_a_glimpse_is_not_followed_on():
    scans = [seen((0.3 * i, 0.0, CAR, False)) if i < 5 else seen((1.5, 0.0, CAR, True)) for i in range(30)]
    assert extended(scans)[1].scan.max() == 4


@pytest.mark.parametrize("has_sliver", [False, True], ids=["pieces", "pieces, and a sliver that hangs with nothing"])
def test_pieces_that_the_evidence_leaves_of_something_that_halts_give_way_to_the_whole(has_sliver):
    way = stops()
    still_from = next(i for i, (*_, stayed) in enumerate(way) if stayed)
    scans = [
        seen(thing, (thing[0] - 0.7, 0.0, (2.6, 1.8, 1.5), False, "part"))
        if still_from <= i < still_from + 12
        else seen(thing)
        for i, thing in enumerate(way)
    ]
    if has_sliver:
        x = way[-1][0]
        scans[-1] = seen((x - 0.7, 0.0, (1.2, 1.0, 1.0), False), (x, 0.0, CAR, True))
    _, after = extended(scans)
    car = after[np.flatnonzero(after.track == 0)]
    assert car.scan.tolist() == list(range(60))
    assert all(scans[s].boxes.size[j, 0] == CAR[0] for s, j in zip(car.scan, car.segment, strict=True))


def test_no_tracks_stay_no_tracks():
    assert len(extended([seen(), seen(), seen()])[1]) == 0


def test_a_tram_that_hangs_together_with_what_it_meets_for_a_while_is_followed_on():
    tram, both = (20.0, 2.5, 3.3), (20.0, 6.0, 3.3)
    drives = [(0.8 * i, 0.0, tram, i >= 20) for i in range(50)]
    way = [(x, 1.75, both, stayed) if 28 <= i < 33 else (x, y, size, stayed)
           for i, (x, y, size, stayed) in enumerate(drives)]  # fmt: skip
    scans = [seen(thing) for thing in way]
    assert extended(scans)[1].scan.tolist() == list(range(50))
