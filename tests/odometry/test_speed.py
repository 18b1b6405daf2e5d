from dataclasses import replace

import numpy as np
import pytest
from raw_worlds import CANYON, curve, true_poses, worst_distance
from worlds import record, van

from automos.odometry.facing import NEAR_SHARE, NEAR_VIEW, expected_share, is_stationary, score_distances, score_speeds
from automos.odometry.landmarks import Landmarks
from automos.odometry.links import Alignment, Links
from automos.odometry.refine import refine_poses
from automos.odometry.speed import SpeedSearch, lengthen, search_speed, speed_figures
from automos.odometry.submap import make_submap
from automos.odometry.surfels import surfels_of
from automos.odometry.window import Window
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()
N, SPEED = 30, 8.0

TRAFFIC = (van(8.0, 0.0, 0.0, SPEED), van(-9.0, 0.2, 0.0, SPEED), van(2.0, 3.5, 0.0, SPEED), van(-5.0, 3.5, 0.0, SPEED))


def window_of(world, poses) -> Window:
    surfels = [surfels_of(scan.points, None) for scan in world.sequence]
    return Window(surfels, np.zeros((len(poses), 6)), poses, np.ones(len(poses) - 1), 0.1, 0.0)


def shortened(poses, ratio):
    """Return the poses with all steps `ratio` as long, as traffic at the sensor's own speed makes them."""
    steps = np.linalg.inv(poses[:-1]) @ poses[1:]
    return lengthen(poses, (ratio - 1.0) * steps[:, :3, 3])


@pytest.fixture(scope="module")
def canyon():
    pose = curve(SPEED, 0.0)
    world = record((*CANYON, *TRAFFIC), np.array([pose(0.1 * i) for i in range(N)]), n_beams=32)
    return world, true_poses(pose, N)


@pytest.mark.parametrize("ratio", [0.9, 0.6, 0.3])
def test_steps_too_short_are_found_by_what_faces_along_the_street(canyon, ratio):
    world, truth = canyon
    window = window_of(world, shortened(truth, ratio))
    missing = search_speed(window, SETTINGS).missing
    np.testing.assert_allclose(missing[:, 0], (1.0 - ratio) * 0.1 * SPEED, atol=0.04)
    np.testing.assert_allclose(missing[:, 1:], 0.0, atol=0.01)
    refined, _ = refine_poses(window.moved(lengthen(window.T_world_sensor, missing)), SETTINGS, Links(Alignment()))
    assert worst_distance(refined.T_world_sensor, truth) < 0.005 * SPEED * 0.1 * N  # half a per cent


def test_without_it_refinement_keeps_step_with_the_traffic(canyon):
    world, truth = canyon
    window = window_of(world, shortened(truth, 0.3))
    refined, _ = refine_poses(window, SETTINGS, Links(Alignment()))
    assert worst_distance(refined.T_world_sensor, truth) > 5.0


def test_right_steps_stay(canyon):
    world, truth = canyon
    assert not search_speed(window_of(world, truth), SETTINGS).missing.any()


def test_who_brakes_finds_again_over_both_lags_what_stands():
    pose = curve(1.0, 0.0)  # metres come are told, not seconds
    braking = [9.0 * t - 3.5 * t**2 for t in 0.1 * np.arange(13)]
    truth = np.array([pose(way) for way in braking])
    window = window_of(record(CANYON, truth, n_beams=32), np.linalg.inv(truth[0]) @ truth)
    scores = score_speeds(np.eye(3)[0], window, SETTINGS, None, SETTINGS.max_reverse)
    over_both = scores.refound.sum(axis=1)
    near = [slice(at - 1, at + 2) for at in scores.nearest]
    assert all(of_place[there].max() > 0.95 * of_place.max() for of_place, there in zip(over_both, near, strict=True))


def test_a_vehicle_that_stands_is_not_driven_by_those_who_pass():
    passing = (
        van(-20.0, 3.5, 0.0, 9.0),
        van(-10.0, 3.5, 0.0, 9.0),
        van(0.0, 3.5, 0.0, 9.0),
        van(25.0, -3.5, np.pi, 9.0),
    )
    pose = curve(0.0, 0.0)
    world = record((*CANYON, *passing), np.array([pose(0.1 * i) for i in range(N)]))
    assert not search_speed(window_of(world, true_poses(pose, N)), SETTINGS).missing.any()


def test_steps_lengthened_again_and_again_stay_rigid():
    poses = true_poses(curve(SPEED, 0.1), 100)
    longer = poses
    for _ in range(12):
        longer = lengthen(longer, np.tile([0.1, 0.0, 0.0], (99, 1)))
    np.testing.assert_array_equal(longer[:, :3, :3], poses[:, :3, :3])
    steps = np.linalg.inv(longer[:-1]) @ longer[1:]
    before = np.linalg.inv(poses[:-1]) @ poses[1:]
    np.testing.assert_allclose(steps[:, :3, 3], before[:, :3, 3] + [1.2, 0.0, 0.0], atol=1e-9)


def test_one_scan_misses_nothing(canyon):
    world, truth = canyon
    surfels = [surfels_of(world.sequence[0].points, None)]
    window = Window(surfels, np.zeros((1, 6)), truth[:1], np.ones(0), 0.1, 0.0)
    assert search_speed(window, SETTINGS).missing.shape == (0, 3)


def test_what_cannot_be_traffic_is_told_from_the_rest():
    rng = np.random.default_rng(0)
    flat = np.array([0.0, 0.39, 0.39]) * rng.uniform(-1.0, 1.0, (400, 3))
    low, beside, high = np.array([[10.2, 2.2, 0.6], [10.2, -18.2, 0.6], [12.2, -3.4, 4.2]])
    before = surfels_of((np.concatenate([flat + low, flat + beside, flat + high])).astype(np.float32), None)
    come = np.array([1.6, 0.0, 0.0])  # what is low keeps pace, what is beside or high stays
    after = np.concatenate([flat + low, flat + beside - come, flat + high - come])
    after = surfels_of(after.astype(np.float32), None)
    submap = make_submap([before], np.eye(4)[None])
    scores = score_distances(submap, after, np.eye(4), np.eye(3)[0], np.array([0.0, 0.8, 1.6]), 0.0, SETTINGS.overhead)
    low, beside, high = scores
    assert low[0] > 0.0 == low[1] == low[2]
    assert beside[2] > 0.0 == beside[0] == beside[1]
    assert high[2] > 0.0 == high[0] == high[1]


def test_who_stands_finds_again_what_is_high_or_else_enough_of_the_rest():
    assert is_stationary(np.array([5.0, 0.0, 30.0]), np.array([400.0, 9.0, 40.0]))
    assert not is_stationary(np.array([200.0, 0.0, 4.0]), np.array([400.0, 9.0, 40.0]))  # traffic at the sensor's speed
    assert is_stationary(np.array([70.0, 10.0, 0.0]), np.array([390.0, 10.0, 1.0]))
    assert not is_stationary(np.array([8.0, 0.0, 0.0]), np.array([400.0, 9.0, 1.0]))


def test_from_nearly_the_same_place_more_is_found_again():
    share = expected_share(np.array([0.0, NEAR_VIEW, -NEAR_VIEW, 100.0]))
    np.testing.assert_allclose(share, NEAR_SHARE * np.array([1.0, np.exp(-1), np.exp(-1), 0.0]), atol=1e-9)


def landmarks(speed: float, refound: float, expected: float = 0.0) -> Landmarks:
    return Landmarks(np.full(4, speed), np.full(4, refound / 4), np.full(4, expected / 4))


def test_poses_that_follow_traffic_are_doubted_and_others_not():
    def search(here: Landmarks, there: Landmarks) -> SpeedSearch:
        return SpeedSearch(np.zeros((3, 3)), np.zeros((3, 3)), here, there, landmarks(-9.0, 0.0))

    right = search(landmarks(10.0, 30.0), landmarks(10.0, 30.0))
    assert not speed_figures([right])["is_speed_doubted"]
    figures = speed_figures([right, search(landmarks(0.0, 0.0), landmarks(22.0, 30.0))])
    assert figures["is_speed_doubted"]
    assert (figures["landmarks_refound"], figures["refound_at_rival"]) == (30.0, 60.0)
    assert figures["rival_faster_m_s"] == pytest.approx(11.0)
    assert speed_figures([search(landmarks(1.0, 1.0, 9.0), landmarks(1.0, 1.0, 9.0))])["is_speed_doubted"]


def test_a_speed_is_clear_if_landmarks_favour_it_and_no_other_comes_near():
    def search(here: Landmarks, there: Landmarks, elsewhere: Landmarks) -> SpeedSearch:
        return SpeedSearch(np.zeros((3, 3)), np.zeros((3, 3)), here, there, elsewhere)

    right, little = landmarks(10.0, 8.0), landmarks(-20.0, 1.0)
    assert search(right, right, little).is_clear
    assert not search(right, landmarks(15.0, 9.0), little).is_clear
    assert not search(right, right, landmarks(-20.0, 7.0)).is_clear
    assert not search(landmarks(0.0, 0.0), landmarks(0.0, 0.0), landmarks(30.0, 0.0)).is_clear


@pytest.mark.parametrize("first", [0, 93])
def test_places_scored_before_are_not_scored_again(canyon, first):
    world, truth = canyon
    window, scored = replace(window_of(world, truth), first=first), {}
    for n in (12, 17, 25):
        search_speed(window.part(0, n), SETTINGS, scored=scored)
    (known,) = scored.values()
    later = window.part(3)
    found = search_speed(later, SETTINGS, scored=scored)
    (places,) = scored.values()
    assert min(places) >= first + 3
    shared = places.keys() & known.keys()
    assert len(shared) >= 3
    assert len(places.keys() - known.keys()) <= 2
    assert all(places[number] is known[number] for number in shared)
    fresh = search_speed(later, SETTINGS, scored={})
    np.testing.assert_allclose(found.landmarks.refound, fresh.landmarks.refound, atol=1e-9)
    np.testing.assert_allclose(found.missing, fresh.missing, atol=1e-9)
