"""Which tracklets are one body."""

import numpy as np

from automos.objects.bodies import cut_where_two, joined, links_in_time
from automos.objects.parts import parts_of_bodies
from automos.objects.tracks import Tracks

TIMES = 0.1 * np.arange(60)


def track(number, scans, x, y=0.0, velocity=(0.0, 0.0), size=(4.0, 1.8, 1.5)):
    scans = np.asarray(scans)
    n = len(scans)
    center = np.column_stack([np.broadcast_to(x, n), np.broadcast_to(y, n), np.zeros(n)])
    v = np.tile([*velocity, 0.0], (n, 1))
    return Tracks(np.full(n, number), scans, np.full(n, number), center, np.tile(size, (n, 1)), np.zeros(n), v)


def body_of(tracks, is_moving, n_points):
    owner = parts_of_bodies(tracks, is_moving, is_moving, np.bincount(tracks.track, n_points[tracks.track]), TIMES)
    is_whole = np.bincount(tracks.track, owner == tracks.track, len(tracks)) > 0
    links = links_in_time(tracks, is_moving, is_whole, np.zeros(len(tracks.track)), TIMES)
    return joined(tracks, owner, *links, n_points[tracks.track])


def test_a_mirror_that_goes_with_a_car_is_its_part_and_a_post_that_it_passes_is_not():
    scans = np.arange(20)
    x = 0.5 * scans
    car, mirror = track(0, scans, x, velocity=(5.0, 0.0)), track(1, scans, x + 1.0, 1.0, (5.0, 0.0), (0.2, 0.2, 0.2))
    post = track(2, scans, 5.0, 1.0, size=(0.2, 0.2, 1.5))
    tracks = Tracks.concatenate([car, mirror, post])
    bodies, parts = body_of(tracks, np.array([True, True, False]), np.array([200.0, 5.0, 20.0]))
    assert len(bodies) == 2
    assert sorted(np.bincount(parts.track)) == [20, 40]
    assert set(bodies.segment) == {0, 2}  # the car's own segment is the main one


def test_what_is_left_of_a_car_to_see_as_it_leaves_sight_is_its_part():
    scans = np.arange(10, 30)
    car, small = track(0, scans, 0.5 * scans, velocity=(5.0, 0.0)), (0.2, 0.2, 0.2)
    before, after = np.arange(4, 9), np.arange(31, 36)
    scraps = [track(1, before, 0.5 * before + 1.5, size=small), track(2, after, 0.5 * after - 1.5, size=small)]
    late = np.arange(48, 53)  # two seconds after: nobody knows where the car is
    post = np.arange(20, 44)  # seen longer than the car can be there
    others = [track(3, post, 16.0, size=small), track(4, late, 0.5 * late, size=small)]
    tracks, is_moving = Tracks.concatenate([car, *scraps, *others]), np.arange(5) == 0
    bodies, parts = body_of(tracks, is_moving, np.array([200.0, 5.0, 5.0, 5.0, 5.0]))
    assert sorted(np.bincount(parts.track)) == [5, 24, 30]
    assert len(bodies) == 3


def test_all_that_stays_where_a_car_stands_is_its_part_as_long_as_something_is_seen_there():
    scans, small = np.arange(10), (0.5, 0.5, 0.5)
    car = track(0, scans, 0.05 * scans)
    there = [track(1, np.arange(14, 30), 1.5, size=small), track(2, np.arange(32, 60), -1.0, 0.5, size=small)]
    beside = track(3, np.arange(14, 30), 1.5, 2.0, size=small)
    tracks, n_points = Tracks.concatenate([car, *there, beside]), np.array([20.0, 90.0, 90.0, 90.0])
    is_moving = np.arange(4) == 0
    for _ in range(2):  # what is seen next is known once what was seen before is
        bodies, parts = body_of(tracks, is_moving, n_points)
        tracks, is_moving, n_points = parts, np.arange(len(bodies)) == 0, np.full(len(bodies), 20.0)
    assert len(bodies) == 2
    assert bodies.scan[bodies.track == 0].max() == 59


def test_what_comes_or_goes_where_a_car_stood_and_what_is_there_much_later_is_another():
    scans = np.arange(5)
    car, comes = track(0, scans, 0.0), track(1, np.arange(9, 30), np.maximum(4.0 - 0.5 * np.arange(21), 0.0))
    much_later = track(2, np.arange(58, 60), 0.0)
    tracks = Tracks.concatenate([car, comes, much_later])
    owner = parts_of_bodies(tracks, np.arange(3) == 0, np.arange(3) == 0, np.array([9.0, 90.0, 9.0]), TIMES)
    np.testing.assert_array_equal(owner, tracks.track)


def test_a_slip_of_the_body_does_not_make_what_stands_in_it_another():
    scans = np.arange(30)
    car, door = track(0, scans, np.where(scans < 20, 0.0, 1.0)), track(1, scans, 0.5, size=(0.5, 0.5, 0.5))
    tracks = Tracks.concatenate([car, door])
    owner = parts_of_bodies(tracks, *2 * [np.array([True, False])], np.array([90.0, 9.0]), TIMES)
    assert (owner == 0).all()


def test_the_roof_of_a_lorry_goes_with_its_wheels_and_a_bridge_does_not():
    scans = np.arange(20)
    low, high = (track(k, scans, 0.5 * scans, velocity=(5.0, 0.0), size=(8.0, 2.5, 1.5)) for k in range(2))
    high.center[:, 2] = 1.6
    bridge = track(2, scans, 5.0, size=(0.5, 0.5, 0.5))
    bridge.center[:, 2] = 5.0
    tracks = Tracks.concatenate([low, high, bridge])
    bodies, _ = body_of(tracks, np.array([True, True, False]), np.array([50.0, 40.0, 20.0]))
    assert len(bodies) == 2


def test_what_stands_beside_a_body_that_stands_is_another_and_what_is_in_its_box_is_its_part():
    scans, post = np.arange(20), (0.2, 0.2, 0.2)
    for beside, n in ((1.15, 2), (0.6, 1)):  # half of the car's width is 0.9 m
        tracks = Tracks.concatenate([track(0, scans, 0.0), track(1, scans, 1.0, beside, size=post)])
        bodies, _ = body_of(tracks, np.array([True, False]), np.array([200.0, 5.0]))
        assert len(bodies) == n


def test_people_side_by_side_are_two():
    scans, person = np.arange(30), (0.5, 0.5, 1.7)
    pair = [track(k, scans, 0.13 * scans, 0.9 * k, (1.3, 0.0), person) for k in range(2)]
    bodies, _ = body_of(Tracks.concatenate(pair), np.array([True, True]), np.array([50.0, 40.0]))
    assert len(bodies) == 2


def test_what_is_hidden_for_a_second_goes_on_and_what_comes_the_other_way_is_another():
    before, after = np.arange(20), np.arange(30, 50)
    going = [track(0, before, before * 1.0, velocity=(10.0, 0.0)), track(1, after, after * 1.0, velocity=(10.0, 0.0))]
    bodies, _ = body_of(Tracks.concatenate(going), np.array([True, True]), np.array([50.0, 50.0]))
    assert len(bodies) == 1
    coming = track(1, after, 60.0 - after * 1.0, velocity=(-10.0, 0.0))
    bodies, _ = body_of(Tracks.concatenate([going[0], coming]), np.array([True, True]), np.array([50.0, 50.0]))
    assert len(bodies) == 2


def departure(evidence):
    """Return the tracks that are left of one that stands, is lost for a second, and goes on beside at 3 m/s."""
    before, after = np.arange(20), np.arange(30, 50)
    rows = [track(0, before, 0.0), track(0, after, 0.1 * 3.0 * (after - 25.0), velocity=(3.0, 0.0))]
    tracks = Tracks.concatenate(rows)
    stands = tracks.scan < 20
    return cut_where_two(tracks, np.array([True]), np.where(stands, evidence, 0.5), TIMES)


def test_what_stood_and_drives_off_is_one_unless_its_place_was_never_free():
    assert len(departure(1.0)) == 1
    assert len(departure(-2.5)) == 2


def halting(speed, evidence=-1.0):
    """Return the links of a car that goes on as what stands at its end, and that as another after a second."""
    before, after, again = np.arange(20), np.arange(20, 40), np.arange(50, 60)
    rows = [track(0, before, 0.1 * speed * (before - 19), velocity=(speed, 0.0)), track(1, after, 0.0)]
    tracks = Tracks.concatenate([*rows, track(2, again, 0.0)])
    moves = np.array([True, False, False])
    return links_in_time(tracks, moves, np.ones(3, bool), np.where(tracks.scan < 20, 2.0, evidence), TIMES)


def test_what_halts_slowly_stands_where_it_was_itself_and_goes_on_through_all_sights():
    ends, beginnings = halting(0.5)
    assert sorted(zip(ends, beginnings, strict=True)) == [(0, 1), (1, 2)]


def test_what_stood_before_a_fast_one_came_is_not_that():
    ends, _ = halting(8.0, evidence=-4.0)
    assert len(ends) == 0


def test_what_is_seen_twice_for_a_while_is_one_unless_it_ends_far_from_where_it_goes_on():
    first, then = np.arange(20), np.arange(15, 40)
    for speed, n in ((10.0, 1), (-10.0, 0)):
        goes_on = track(1, then, 15.0 + 0.1 * speed * (then - 15), velocity=(10.0, 0.0))
        tracks = Tracks.concatenate([track(0, first, 1.0 * first, velocity=(10.0, 0.0)), goes_on])
        ends, _ = links_in_time(tracks, np.ones(2, bool), np.ones(2, bool), np.ones(45), TIMES)
        assert len(ends) == n


def test_what_never_moved_is_linked_with_nothing():
    scans = np.arange(20)
    tracks = Tracks.concatenate([track(0, scans, 0.0), track(1, scans + 25, 0.0)])
    ends, _ = links_in_time(tracks, np.zeros(2, bool), np.ones(2, bool), np.zeros(40), TIMES)
    assert len(ends) == 0


def test_as_the_corner_that_is_left_to_see_a_car_goes_on():
    car = track(0, np.arange(20), 0.05 * np.arange(-19, 1), velocity=(0.5, 0.0), size=(4.9, 2.0, 1.6))
    corner = track(1, np.arange(20, 40), 1.5, 0.6, size=(1.6, 0.8, 1.3))
    tracks, moves, whole = Tracks.concatenate([car, corner]), np.array([True, False]), np.ones(2, bool)
    ends, _ = links_in_time(tracks, moves, whole, np.zeros(40), TIMES)
    assert len(ends) == 1


def appearing(x_after):
    """Return the tracks left of a tram that comes out from behind something at 10 m/s and is lost for three scans."""
    before, after = np.arange(20), np.arange(23, 40)
    length = np.concatenate([1.0 + before, np.full(len(after), 24.0)])
    scans = np.concatenate([before, after])
    front = np.concatenate([1.0 * before, x_after + 1.0 * (after - 23)])
    rows = track(0, scans, front - 0.5 * length, velocity=(10.0, 0.0))
    rows.size[:, 0] = length
    return cut_where_two(rows, np.array([True]), np.full(len(scans), 2.0), TIMES)


def test_what_comes_out_from_behind_something_goes_on_where_its_front_does():
    assert len(appearing(23.0)) == 1  # its centre stood at 9.5 m, and sets off with 10 m/s
    assert len(appearing(40.0)) == 2


def test_no_tracks_are_no_bodies():
    none = track(0, np.zeros(0, int), 0.0)
    bodies, parts = body_of(none, np.zeros(0, bool), np.zeros(0))
    assert len(bodies) == len(parts) == 0
