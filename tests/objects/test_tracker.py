import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from automos.core.geometry import make_transform, wrap_angle
from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.tracker import can_follow, track_objects
from automos.settings import load_settings

SETTINGS = load_settings("paper").tracking
CAR = (4.5, 1.8, 1.5)


def boxes(centers, size=CAR, yaw=0.0) -> Boxes:
    centers = np.asarray(centers, float).reshape(-1, 3)
    n = len(centers)
    return Boxes(centers, np.tile(np.asarray(size, float), (n, 1)), np.full(n, yaw), np.ones(n))


def track(scans, stamps=None, **changes):
    stamps = 0.1 * np.arange(len(scans)) if stamps is None else stamps
    found = [Detections.of_objects(boxes, *np.zeros((3, len(boxes)))) for boxes in scans]
    return track_objects(zip(stamps, found, strict=True), SETTINGS.model_copy(update=changes))


def drive(n: int, speed: float, missed=(), start=0.0) -> list[Boxes]:
    """Return the detections of one car along x at `speed` m/s, none in scans `missed`."""
    return [boxes([] if i in missed else [start + 0.1 * speed * i, 2.0, 0.75]) for i in range(n)]


@pytest.mark.parametrize("speed", [0.0, 1.5, 10.0, 15.0, -15.0])
def test_a_car_at_constant_velocity_is_one_track_with_that_velocity(speed):
    # 15 m/s: 1.5 m to the second scan, within the gate of 2 m; from then on the velocity is known
    tracks = track(drive(30, speed))
    assert len(tracks) == 1
    np.testing.assert_array_equal(tracks.scan, np.arange(30))
    assert tracks.is_observed.all()
    # the very first step is taken at gain 0.9999 (a new box is uncertain by sqrt(10) m, a measured one by 1)
    np.testing.assert_allclose(tracks.center[:, 0], 0.1 * speed * np.arange(30), atol=0.01)
    np.testing.assert_allclose(tracks.velocity[1:], np.tile([speed, 0.0, 0.0], (29, 1)), atol=0.05)
    np.testing.assert_allclose(tracks.size, np.tile(CAR, (30, 1)))


def test_a_car_that_jumps_past_the_gate_before_its_velocity_is_known_is_a_new_one_every_time():
    assert len(track(drive(10, 21.0))) == 10  # the paper's limit: T_d is 2 m, 2.1 m a scan are too far


@pytest.mark.parametrize("speed", [0.0, 10.0])
@pytest.mark.parametrize(("n_missed", "n_tracks"), [(1, 1), (4, 1), (5, 1), (6, 2), (9, 2)])
def test_an_object_missed_five_times_is_found_again_and_six_times_is_not(speed, n_missed, n_tracks):
    missed = range(8, 8 + n_missed)
    tracks = track(drive(25, speed, missed))
    assert len(tracks) == n_tracks
    if n_tracks == 1:
        # where it was missed it is predicted, on its way
        np.testing.assert_array_equal(tracks.scan[~tracks.is_observed], list(missed))
        np.testing.assert_allclose(tracks.center[:, 0], 0.1 * speed * np.arange(25), atol=0.05)
    else:
        np.testing.assert_array_equal(tracks.scan[tracks.track == 0], range(8))
        np.testing.assert_array_equal(tracks.scan[tracks.track == 1], range(8 + n_missed, 25))


@pytest.mark.parametrize("max_misses", [0, 1, 3])
def test_how_often_an_object_may_be_missed_is_a_setting(max_misses):
    for n_missed, n_tracks in ((max_misses, 1), (max_misses + 1, 2)):
        assert len(track(drive(20, 5.0, range(8, 8 + n_missed)), max_misses=max_misses)) == n_tracks


def test_only_consecutive_misses_count():
    # seen in two scans of six for 60 scans: 40 misses in all, four at a time
    tracks = track(drive(60, 5.0, [i for i in range(60) if i % 6 > 1]))
    assert len(tracks) == 1
    assert tracks.is_observed.sum() == 20


def test_a_track_ends_at_its_last_observation():
    tracks = track([*drive(8, 5.0), *[boxes([])] * 3])
    np.testing.assert_array_equal(tracks.scan, range(8))


def test_stamps_carry_the_prediction_through_a_gap_in_time():
    # 10 m/s, and 0.4 s are missing after scan 5: 5 m on, far past the gate if the time were not known
    stamps = 0.1 * np.arange(12) + np.where(np.arange(12) > 5, 0.4, 0.0)
    scans = [boxes([10.0 * t, 2.0, 0.75]) for t in stamps]
    assert len(track(scans, stamps)) == 1
    assert len(track(scans, 0.1 * np.arange(12))) == 2


def test_objects_that_cross_keep_their_numbers():
    # at right angles through one place, half a second apart; then head on, two metres beside each other
    t = 0.1 * np.arange(40)
    east = np.column_stack([10.0 * (t - 2.0), np.zeros(40), np.full(40, 0.75)])
    north = np.column_stack([np.zeros(40), 10.0 * (t - 2.5), np.full(40, 0.75)])
    west = np.column_stack([-10.0 * (t - 2.0), np.full(40, 2.5), np.full(40, 0.75)])
    parts = [[boxes(east[i]), boxes(north[i], yaw=np.pi / 2), boxes(west[i], yaw=np.pi)] for i in range(40)]
    rng = np.random.default_rng(0)
    order = [rng.permutation(3) for _ in range(40)]
    tracks = track([Boxes.concatenate(p)[o] for p, o in zip(parts, order, strict=True)])
    assert len(tracks) == 3
    for k in range(3):
        rows = tracks.rows_of(k)
        objects = [order[s][d] for s, d in zip(tracks.scan[rows], tracks.segment[rows], strict=True)]
        assert len(set(objects)) == 1
        assert len(objects) == 40


def test_an_object_that_comes_closer_to_another_than_itself_is_told_by_the_best_assignment():
    # predicted at 0 and 1; seen at 0.9 and 1.9: nearest first would pair 1 with 0.9 and lose the rest
    tracks = track([boxes([[0, 0, 0], [1, 0, 0]]), boxes([[0.9, 0, 0], [1.9, 0, 0]])])
    np.testing.assert_array_equal(tracks.segment, [0, 0, 1, 1])


def test_numbers_are_given_in_order_and_never_again():
    # one object a scan, each 50 m from the last and never seen again
    tracks = track([boxes([50.0 * i, 0, 0]) for i in range(30)])
    np.testing.assert_array_equal(tracks.track, np.arange(30))
    np.testing.assert_array_equal(tracks.scan, np.arange(30))


def test_the_table_is_sorted_by_track_then_scan_and_names_segments_by_their_row():
    rng = np.random.default_rng(0)
    tracks = track([boxes(rng.uniform(-20, 20, (rng.integers(0, 9), 3))) for _ in range(20)])
    order = np.lexsort((tracks.scan, tracks.track))
    np.testing.assert_array_equal(order, np.arange(len(order)))
    np.testing.assert_array_equal(np.unique(tracks.track), np.arange(len(tracks)))


def test_every_detection_belongs_to_exactly_one_track():
    rng = np.random.default_rng(1)
    scans = [boxes(rng.uniform(-8, 8, (rng.integers(0, 9), 3)) * [1, 1, 0.1]) for _ in range(30)]
    tracks = track(scans)
    seen = tracks.is_observed
    pairs = set(zip(tracks.scan[seen].tolist(), tracks.segment[seen].tolist(), strict=True))
    assert len(pairs) == seen.sum() == sum(map(len, scans))


def test_the_order_of_detections_changes_numbers_only():
    rng = np.random.default_rng(2)
    starts, velocity = rng.uniform(-30, 30, (6, 3)) * [1, 1, 0], rng.uniform(-8, 8, (6, 3)) * [1, 1, 0]
    scans = [boxes(starts + 0.1 * i * velocity) for i in range(15)]
    order = [rng.permutation(6) for _ in scans]
    straight, shuffled = track(scans), track([s[o] for s, o in zip(scans, order, strict=True)])

    def trajectories(tracks):
        return sorted(tracks.center[tracks.rows_of(k)].round(6).tolist() for k in range(len(tracks)))

    assert trajectories(straight) == trajectories(shuffled)


@pytest.mark.parametrize("turn", [0.3, 2.0, -3.0])
def test_a_turned_and_shifted_world_has_turned_and_shifted_tracks(turn):
    T = make_transform(Rotation.from_euler("z", turn).as_matrix(), [300.0, -50.0, 2.0])
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, 0.05, (12, 2, 3))
    scans = [boxes(np.array([[i, 0.0, 0.0], [0.0, 10.0 - i, 0.5]]) + noise[i], yaw=0.2) for i in range(12)]
    here, there = track(scans), track([s.transformed(T) for s in scans])
    np.testing.assert_array_equal(there.segment, here.segment)
    moved = here.boxes.transformed(T)
    np.testing.assert_allclose(there.center, moved.center, atol=1e-6)
    np.testing.assert_allclose(wrap_angle(there.yaw - moved.yaw), 0.0, atol=1e-6)
    np.testing.assert_allclose(there.velocity, here.velocity @ T[:3, :3].T, atol=1e-6)


@pytest.mark.parametrize("n_scans", [0, 1, 5])
def test_without_detections_there_are_no_tracks(n_scans):
    assert len(track([boxes([])] * n_scans)) == 0


def test_one_scan_makes_tracks_of_one_row():
    tracks = track([boxes([[0, 0, 0], [10, 0, 0]])])
    np.testing.assert_array_equal(tracks.segment, [0, 1])
    np.testing.assert_array_equal(tracks.velocity, np.zeros((2, 3)))


def test_ten_scans_a_second_are_followed_and_two_are_not():
    assert can_follow(0.1 * np.arange(20))
    assert not can_follow(0.5 * np.arange(20))
    assert can_follow(np.zeros(1))
