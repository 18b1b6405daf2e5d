import numpy as np
import pytest

from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.extents import headings, make_whole, shown_intervals
from automos.objects.terms import Segments, segment_terms
from automos.objects.tracks import Tracks


def rows(n: int, center: np.ndarray) -> Tracks:
    """Return one track of n scans."""
    here = np.arange(n)
    return Tracks(
        np.zeros(n, np.int64), here, np.zeros(n, np.int64), center, np.ones((n, 3)), np.zeros(n), np.zeros((n, 3))
    )


def segments_of(
    own: Boxes, sensor: np.ndarray, hidden: np.ndarray | None = None, n_points: np.ndarray | None = None
) -> Segments:
    """Return segments of which each scan has one, with the boxes `own`, of a thousand points if none are given."""
    none, hidden = np.zeros(1), np.zeros((len(own), 2), np.bool_) if hidden is None else hidden
    n_points = np.full(len(own), 1e3) if n_points is None else n_points
    found = (
        Detections.of_objects(own[at], n_points[at], none, none, hidden=hidden[at], sensor=tuple(sensor[at[0], :2]))
        for at in np.arange(len(own))[:, None]
    )
    return Segments.of_scans(list(map(segment_terms, found)))


def made_whole(
    own: Boxes, sensor: np.ndarray, hidden: np.ndarray | None = None, n_points: np.ndarray | None = None
) -> Tracks:
    """Return the whole boxes of a body of which each scan shows one of the boxes `own`, ten scans a second."""
    tracks, segments = rows(len(own), own.center.copy()), segments_of(own, sensor, hidden, n_points)
    make_whole(tracks, tracks, np.ones(1, np.bool_), segments, 0.1 * np.arange(len(own)))
    return tracks


@pytest.mark.parametrize("turn", [0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi])
def test_the_interval_of_a_box_is_its_length_along_its_heading_and_its_width_along_its_side(turn):
    own = Boxes(np.array([[10.0, 2.0, 1.0]]), np.array([[4.0, 2.0, 1.5]]), np.array([0.3]), np.ones(1))
    track = rows(1, np.array([[9.0, 2.0, 1.0]]))
    track.yaw[:] = 0.3 + turn
    low, high, *_ = shown_intervals(track, track, segments_of(own, np.zeros((1, 2))))
    half = 0.5 * np.array([4.0, 2.0, 1.5] if abs(np.cos(turn)) > 0.5 else [2.0, 4.0, 1.5])
    np.testing.assert_allclose(0.5 * (high - low)[0], half, atol=2e-3)
    angle = 0.3 + turn  # the box is a metre ahead of the track along x
    np.testing.assert_allclose(0.5 * (high + low)[0], [np.cos(angle), -np.sin(angle), 0.0], atol=2e-3)


def test_the_place_of_the_sensor_is_told_along_the_heading():
    track = rows(2, np.array([[10.0, 0.0, 1.0], [12.0, 0.0, 1.0]]))
    track.yaw[:] = 0.5 * np.pi
    own = Boxes(track.center, np.ones((2, 3)), np.zeros(2), np.ones(2))
    shown = shown_intervals(track, track, segments_of(own, np.array([[0.0, 0.0], [2.0, 3.0]])))
    np.testing.assert_allclose(shown.sensor, [[0.0, 10.0], [3.0, 10.0]], atol=1e-6)


def test_a_row_shows_all_of_its_parts_and_what_hides_their_outer_ends_and_none_where_it_was_missed():
    # A lorry's front and rear, 10 m ahead; the sensor is at the origin, so more y is to its left.
    own = Boxes(np.array([[10.0, -3.0, 1.0], [10.0, 4.0, 2.0]]), np.ones((2, 3)), np.zeros(2), np.ones(2))
    nothing = np.zeros(2)
    for hides, told in (([[False, True], [True, False]], [True, True]), ([[True, False], [False, True]], [False] * 2)):
        found = Detections.of_objects(own, nothing, nothing, nothing, hidden=np.array(hides))
        segments = Segments.of_scans([segment_terms(found), segment_terms(Detections.nothing())])
        body = rows(2, np.tile([10.0, 0.0, 1.0], (2, 1)))
        body.segment[1] = -1
        parts = Tracks.of_segments(np.zeros(2, int), np.zeros(2, int), np.arange(2), nothing)
        shown = shown_intervals(body, parts, segments)
        np.testing.assert_allclose(shown.low, [[-0.5, -3.5, -0.5], [np.nan] * 3])
        np.testing.assert_allclose(shown.high, [[0.5, 4.5, 1.5], [np.nan] * 3])
        np.testing.assert_array_equal(shown.hidden, [told, [False, False]])


def test_a_car_that_stands_has_no_velocity_though_its_front_comes_into_sight_and_goes():
    rear = np.concatenate([np.arange(20) * 0.5, np.full(30, 10.0)])
    length = np.where(np.arange(50) % 3 == 0, 1.0, 4.0)
    center = np.column_stack([rear + 0.5 * length, np.zeros(50), np.ones(50)])
    own = Boxes(center, np.column_stack([length, np.full(50, 1.8), np.full(50, 1.5)]), np.zeros(50), np.ones(50))
    found = made_whole(own, np.tile([-20.0, 0.0, 1.5], (50, 1)))
    assert np.abs(found.velocity[25:]).max() < 0.2
    np.testing.assert_allclose(found.velocity[5:15, 0], 5.0, atol=0.3)
    np.testing.assert_allclose(found.size, np.tile([4.5, 1.8, 1.6], (50, 1)), atol=3e-3)  # its front end is never seen
    np.testing.assert_allclose(found.center[30:, 0], 12.25, atol=0.1)


@pytest.mark.parametrize(
    ("origin", "hides", "length", "width"),
    [
        ((8.0, -15.0), None, 4.1, 1.85),  # from aside
        ((-20.0, -2.0), None, 4.5, 1.8),  # from behind, a little aside
        ((-20.0, -20.0), None, 4.1, 1.8),  # from half aside, half behind
        ((8.0, -15.0), 0, 4.5, 1.85),  # from aside, with something before its rear
        ((8.0, -15.0), 1, 4.5, 1.85),
    ],
)
def test_a_car_is_as_long_as_it_showed_if_both_ends_were_seen(origin, hides, length, width):
    n = 20
    own = Boxes(
        np.column_stack([np.arange(n) * 0.8, np.zeros(n), np.ones(n)]), np.tile([4.1, 1.8, 1.6], (n, 1)), *np.eye(2, n)
    )
    own.yaw[:] = 0.0
    hidden = np.zeros((n, 2), np.bool_)
    if hides is not None:
        hidden[:, hides] = True
    beside = np.column_stack([own.center[:, 0] + origin[0] - 8.0, np.full(n, origin[1]), np.full(n, 1.8)])
    found = made_whole(own, beside, hidden)
    np.testing.assert_allclose(found.size[:, :2], np.tile([length, width], (n, 1)), atol=3e-3)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_car_that_drives_out_from_behind_something_keeps_its_velocity_as_its_own_end_is_seen(side):
    # Seen from its side it comes out at x = 0, whole after a second: first its front, then all of it.
    n, length = 40, 4.0
    front = side * (0.4 * np.arange(1, n + 1))
    rear = np.where(side * front < length, 0.0, front - side * length)
    center = np.column_stack([0.5 * (front + rear), np.full(n, 10.0), np.full(n, 0.8)])
    own = Boxes(center, np.column_stack([np.abs(front - rear), np.full((n, 2), (1.8, 1.5))]), np.zeros(n), np.ones(n))
    hidden = np.zeros((n, 2), np.bool_)
    hidden[:9, 0 if side > 0.0 else 1] = True  # the sensor is at the origin, so what is at less x is to its left
    found = made_whole(own, np.zeros((n, 3)), hidden)
    np.testing.assert_allclose(found.velocity[:, 0], 4.0 * side, atol=0.2)
    np.testing.assert_allclose(found.center[:, 0], front - 0.5 * side * length, atol=0.15)
    assert np.abs(made_whole(own, np.zeros((n, 3))).velocity[:5, 0] - 4.0 * side).max() > 1.0  # without that


def heading(path: np.ndarray, length: np.ndarray, yaw: float) -> np.ndarray:
    """Return the headings, degrees, of a body on `path` (N, 2), ten scans a second, that shows a side at `yaw`."""
    n = len(path)
    path = np.column_stack([path, np.zeros(n)])
    found = headings(np.array([0, n]), 0.1 * np.arange(n), path, np.full(n, yaw), length)
    return np.degrees(np.angle(np.exp(1j * found)))


def test_a_car_that_stops_is_not_turned_by_a_centre_that_slips_aside_by_a_metre():
    # It is one segment with the car beside it for a second, whose middle is between the two.
    east = np.concatenate([np.arange(20) * 0.5, np.full(20, 9.75)])
    north = np.zeros(40)
    north[22:32] = np.hanning(10)
    np.testing.assert_allclose(heading(np.column_stack([east, north]), np.full(40, 4.4), 0.0), 0.0, atol=1.0)


def test_a_car_that_stands_lies_along_the_sides_that_it_shows_whatever_its_last_way():
    # What shows of it as it comes nearer and stops takes its centre aside.
    east = np.concatenate([np.arange(20) * 0.5, np.full(60, 9.75)])
    north = np.interp(np.arange(80), [14, 20], [0.0, 1.2])
    rng = np.random.default_rng(0)
    path = np.column_stack([east, north, np.zeros(80)])
    yaw = rng.normal(0.0, np.radians(3.0), 80) + 0.5 * np.pi * (np.arange(80) % 3 == 0)  # of its rear, every third
    found = np.degrees(headings(np.array([0, 80]), 0.1 * np.arange(80), path, yaw, np.full(80, 4.4)))
    np.testing.assert_allclose(found[50:], 0.0, atol=2.0)
    assert np.ptp(found[50:]) < 0.1


def test_a_person_turns_on_the_spot():
    east = np.concatenate([np.arange(15) * 0.14, np.full(15, 1.96)])
    north = np.concatenate([np.zeros(15), np.arange(15) * 0.14])
    found = heading(np.column_stack([east, north]), np.zeros(30), 0.0)
    np.testing.assert_allclose(found[:9], 0.0, atol=1.0)
    np.testing.assert_allclose(found[-8:], 90.0, atol=1.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_has_gone_less_than_half_of_its_length_lies_along_it(way):
    path = np.linspace([0.0, 0.0], [way * 0.8, 1.2], 20)  # steeper than half a right angle
    found = heading(path, np.full(20, 4.4), 0.0)
    np.testing.assert_allclose(found, 0.0 if way > 0.0 else 180.0, atol=1e-6)


def test_what_a_body_never_showed_is_behind_it_and_moves_it_not_as_the_sensor_passes():
    n = 60
    own = Boxes(np.tile([0.0, 5.0, 0.9], (n, 1)), np.tile([0.2, 0.2, 1.7], (n, 1)), np.zeros(n), np.ones(n))
    origin = np.column_stack([np.linspace(-10.0, 10.0, n), np.zeros(n), np.full(n, 1.5)])
    found = made_whole(own, origin)
    assert np.abs(found.velocity).max() < 0.05
    assert (found.size[:, :2] > 0.3).all()  # those of a person
    assert (found.center[:, 1] > 5.1).all()


def test_what_does_not_move_keeps_its_box_at_rest():
    tracks = rows(3, np.zeros((3, 3)))
    tracks.velocity[:] = 2.0
    own = Boxes(np.zeros((3, 3)), np.full((3, 3), 2.0), np.zeros(3), np.ones(3))
    make_whole(tracks, tracks, np.zeros(1, np.bool_), segments_of(own, np.zeros((3, 2))), np.arange(3.0))
    assert not tracks.velocity.any()
    np.testing.assert_array_equal(tracks.size, 1.0)


def test_a_scrap_of_a_car_says_little_of_where_the_car_is():
    n = 40
    center, size = np.tile([20.0, 5.0, 1.0], (n, 1)), np.tile([4.5, 1.8, 1.5], (n, 1))
    n_points = np.full(n, 500.0)
    scrap = np.arange(18, 22)  # for a moment only a piece of its roof is seen
    center[scrap], size[scrap], n_points[scrap] = (21.5, 5.5, 1.6), (0.4, 0.2, 0.1), 5.0
    own = Boxes(center, size, np.zeros(n), np.ones(n))
    found = made_whole(own, np.tile([0.0, 0.0, 1.5], (n, 1)), n_points=n_points)
    off = np.linalg.norm((found.center - [20.0, 5.0, 1.0])[:, :2], axis=1)
    assert off.max() < 0.4
