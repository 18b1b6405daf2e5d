"""The tracker as `default` uses it: fast from the second scan, through gaps, and on while things wait."""

import numpy as np
import pytest

from automos.core.upright_boxes import Boxes
from automos.objects.bodies import cut_where_two
from automos.objects.detections import Detections
from automos.objects.judge import judge_tracks
from automos.objects.terms import Segments, segment_terms
from automos.objects.tracker import track_objects
from automos.objects.tracks import of_rows
from automos.settings import TrackingSettings

CAR, PERSON, POLE = (4.0, 1.8, 1.5), (0.6, 0.5, 1.7), (0.4, 0.4, 1.7)
MOVED, STAYED = 1.0, 0.0


def seen(*things, n_points=80):
    """Segments at (x, y, size, share of points that have moved); a fifth word: a piece of the last of them."""
    center = np.array([[x, y, 0.5 * size[2]] for x, y, size, *_ in things]).reshape(-1, 3)
    size = np.array([thing[2] for thing in things], float).reshape(-1, 3)
    share = np.array([thing[3] for thing in things], float)
    n = np.full(len(things), float(n_points))
    boxes = Boxes(center, size, np.zeros(len(n)), np.ones(len(n)))
    found = Detections.of_objects(boxes, n, n * share, n - n * share)
    found.has_stayed[:] = share == STAYED
    found.part_of[:] = [len(things) - 1 if len(thing) > 4 else -1 for thing in things]
    return found


def track(scans, period=0.1):
    return track_objects([(period * i, found) for i, found in enumerate(scans)], TrackingSettings())


def ways(scans, tracks):
    """The x of what each track was seen as, by scan."""
    return [
        {
            int(s): float(scans[s].boxes.center[j, 0])
            for s, j in zip(tracks.scan[rows], tracks.segment[rows], strict=True)
            if j >= 0
        }
        for rows in (tracks.rows_of(k) for k in range(len(tracks)))
    ]


@pytest.mark.parametrize("known", [1.0, 0.0], ids=["moved", "its places were hidden, as of a car ahead"])
@pytest.mark.parametrize("speed", [1.0, 15.0, 35.0])
@pytest.mark.parametrize("period", [0.05, 0.1, 0.2])
def test_one_object_is_one_track_whatever_its_speed_and_the_sensors_rate(speed, period, known):
    scans = [seen((speed * period * i, 0.0, CAR, MOVED)) for i in range(12)]
    for found in scans:
        found.n_moving[:] *= known
    tracks = track(scans, period)
    assert len(tracks) == 1
    assert tracks.velocity[-1, 0] == pytest.approx(speed, rel=0.02)


def test_a_parked_car_is_not_taken_for_the_next_in_its_row():
    # The first car is hidden when the second, 5 m on, comes into view.
    assert len(track([seen((0.0, 0.0, CAR, STAYED)), seen((5.0, 0.0, CAR, STAYED))])) == 2


@pytest.mark.parametrize(("n_hidden", "n_tracks"), [(0, 1), (5, 1), (10, 2)])
def test_an_object_is_found_again_within_the_gap(n_hidden, n_tracks):
    scans = [seen() if 8 <= i < 8 + n_hidden else seen((1.0 * i, 0.0, CAR, MOVED)) for i in range(20)]
    assert len(track(scans)) == n_tracks


def test_objects_that_meet_keep_their_tracks():
    scans = [seen((i - 10.0, 0.0, CAR, MOVED), (10.0 - i, 2.5, CAR, MOVED)) for i in range(20)]
    found = ways(scans, track(scans))
    assert len(found) == 2
    assert all(abs(way[19] - way[0]) > 15.0 for way in found)


def brakes(speed=6.0, at=20, n=60):
    """x of something that drives and brakes at 3 m/s^2, per scan."""
    v = np.maximum(speed - 0.3 * np.maximum(np.arange(n) - at + 1, 0), 0.0)
    return np.cumsum(0.1 * v)


@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("is_reversed", [False, True], ids=["drives, then waits", "waits, then drives"])
def test_what_moves_and_then_stops_is_one_object(is_reversed, step):
    # a second after it has come to a halt, the evidence calls it static
    scans = [seen((x, 0.0, CAR, STAYED if i >= 50 else MOVED)) for i, x in enumerate(brakes())]
    scans = scans[:: -step if is_reversed else step]
    tracks = track(scans, 0.1 * step)
    assert len(tracks) == 1
    assert tracks.scan.tolist() == list(range(len(scans)))


def test_a_car_that_halts_is_seen_whole_beside_the_piece_that_the_evidence_left_of_it():
    scans = [seen((x, 0.0, CAR, MOVED)) for x in brakes()]
    for i in range(45, 60):
        x = float(brakes()[i])
        scans[i] = seen((x - 0.7, 0.0, (2.6, 1.8, 1.5), MOVED, "piece"), (x, 0.0, CAR, STAYED))
    tracks = track(scans)
    car = tracks[np.arange(*tracks.rows_of(0).indices(len(tracks.track)))]
    assert car.scan.tolist() == list(range(60))
    assert all(scans[s].boxes.size[j, 0] == CAR[0] for s, j in zip(car.scan, car.segment, strict=True))


def test_who_passes_a_post_does_not_become_it():
    # for two scans each of them is nearer to where the other was expected
    person = [0.12 * i - 1.2 for i in range(20)]
    scans = [seen((x, 0.0, PERSON, MOVED), (0.0, 0.8, POLE, STAYED)) for x in person]
    for i in (10, 11):
        scans[i] = seen((person[i], 0.8, PERSON, MOVED), (0.0, 0.0, POLE, STAYED))
    found = ways(scans, track(scans))
    assert len(found) == 2
    assert sorted(abs(way[19] - way[0]) for way in found) == pytest.approx([0.0, 19 * 0.12], abs=0.01)


def test_a_car_that_waits_is_known_again_when_the_one_beside_it_has_gone():
    # for three scans the two hang together in one segment
    scans = [seen((x, 0.0, CAR, STAYED if i >= 50 else MOVED)) for i, x in enumerate(brakes())]
    for i in range(50, 53):
        scans[i] = seen((float(brakes()[i]), 1.0, (5.0, 3.8, 1.5), STAYED))
    tracks = track(scans)
    assert len(tracks) == 1
    assert tracks.scan[-1] == 59


def test_someone_who_walks_out_of_sight_at_a_pole_is_not_the_pole():
    pole = (4.3, 0.2, POLE, STAYED)
    scans = [seen((0.14 * i, 0.0, PERSON, MOVED), pole) if i < 30 else seen(pole) for i in range(60)]
    walker, same_pole = sorted(ways(scans, track(scans)), key=len)
    assert max(walker) == 29
    assert set(same_pole.values()) == {4.3}


def test_a_fast_car_out_of_sight_does_not_become_a_parked_one():
    parked = (16.0, 1.5, CAR, STAYED)
    scans = [seen((0.6 * i, 0.0, CAR, MOVED)) if i < 22 else seen() if i < 30 else seen(parked) for i in range(60)]
    assert sorted(len(way) for way in ways(scans, track(scans))) == [22, 30]


def moving_ways(scans):
    """The x of what each track that has moved was seen as, by scan, once tracks are cut where they are two bodies."""
    tracks, stamps = track(scans), 0.1 * np.arange(len(scans))
    segments = Segments.of_scans([segment_terms(found) for found in scans])
    is_moving = judge_tracks(tracks, segments, stamps).is_moving
    evidence = of_rows(segments.of(tracks), segments.terms.evidence)
    tracks = cut_where_two(tracks, is_moving, evidence, stamps)
    moves = judge_tracks(tracks, segments, stamps).is_moving
    return [way for way, is_mover in zip(ways(scans, tracks), moves, strict=True) if is_mover]


def test_a_pole_out_of_sight_that_is_taken_for_another_does_not_move():
    here, there = (0.0, 0.0, POLE, STAYED), (3.3, 0.0, POLE, STAYED)
    assert not moving_ways([*[seen(here)] * 10, *[seen()] * 7, *[seen(there)] * 10, *[seen(here, there)] * 5])


@pytest.mark.parametrize("n_hidden", [1, 5])
def test_who_is_lost_beside_a_pole_that_comes_into_sight_again_does_not_go_on_as_the_pole(n_hidden):
    pole = (10.0, 0.3, POLE, STAYED)
    walker = [seen((8.0 + 0.1 * i, 0.0, PERSON, MOVED)) for i in range(17)]
    (way,) = moving_ways([*[seen(pole)] * 10, *walker, *[seen()] * n_hidden, *[seen(pole)] * 30])
    assert list(way) == list(range(10, 27))


@pytest.mark.parametrize("n_hidden", [1, 5])
def test_who_is_lost_does_not_go_on_as_a_pole_that_comes_into_sight_where_he_must_be(n_hidden):
    pole = (8.0 + 0.1 * (16 + n_hidden), 0.0, POLE, STAYED)
    walker = [seen((8.0 + 0.1 * i, 0.0, PERSON, MOVED)) for i in range(17)]
    (way,) = moving_ways([*walker, *[seen()] * n_hidden, *[seen(pole)] * 50])
    assert list(way) == list(range(17))


def test_who_steps_out_where_something_stood_is_somebody_else():
    scans = [*[seen((0.0, 0.0, PERSON, STAYED))] * 30, *[seen()] * 5]
    (way,) = moving_ways([*scans, *(seen((0.8 + 0.1 * i, 0.0, PERSON, MOVED)) for i in range(10))])
    assert list(way) == list(range(35, 45))


def test_a_tram_of_which_more_or_less_is_seen_is_followed_on():
    length = 18.0 + 4.0 * np.random.default_rng(3).random(50)  # m; its front is seen, its end is now and then
    scans = [
        seen((0.8 * i - 0.5 * side, 0.0, (side, 2.4, 3.3), STAYED if i >= 20 else MOVED))
        for i, side in enumerate(length)
    ]
    assert len(track(scans)) == 1


def test_no_detections_are_no_tracks():
    assert len(track([seen(), seen()])) == 0
    assert len(track([])) == 0


def test_what_drove_off_out_of_sight_is_not_the_tree_that_has_stood_there():
    # A lost car may have turned that far, and a crown is seen as large; but this one has not just come to rest.
    tree = (9.5, 2.0, (2.8, 2.5, 3.5), STAYED)
    scans = [seen((0.5 * i, 0.0, CAR, MOVED)) if i < 12 else seen() if i < 15 else seen(tree) for i in range(30)]
    assert sorted(len(way) for way in ways(scans, track(scans))) == [12, 15]
