from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from raw_worlds import TOWN, curve, sweep, true_poses, untimed, worst_distance
from worlds import SCAN_GAP

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.scan import Scan
from automos.odometry.doubts import doubts
from automos.odometry.estimate import PosesSoFar, estimate_trajectory
from automos.odometry.estimator import Odometry
from automos.settings import OdometrySettings

N = 20
POSE = curve(7.0, 0.3)
TRUTH = true_poses(POSE, N)
EMPTY = Scan(np.zeros((0, 3), np.float32))
REFINED = OdometrySettings(time="file")


@pytest.fixture(scope="module")
def scans():
    return [sweep(TOWN, POSE, SCAN_GAP * i, n_beams=40) for i in range(N)]


def sequence_of(scans, stamps=None):
    return ArraySequence(scans, stamps=SCAN_GAP * np.arange(len(scans)) if stamps is None else stamps, name="drive")


def test_a_raw_recording_without_times_is_followed_to_within_centimetres(scans):
    trajectory = estimate_trajectory(sequence_of([untimed(s) for s in scans]), OdometrySettings())
    assert trajectory.timing.turn == -1
    assert worst_distance(trajectory.T_world_sensor, TRUTH) < 0.04  # 13 m driven
    np.testing.assert_allclose(trajectory.sweep_motion[:, 0], 0.7, atol=0.03)
    assert trajectory.T_level_world[2, 3] == pytest.approx(1.8, abs=0.03)
    assert trajectory.diagnostics["wall_thickness_m"] < 0.03
    assert trajectory.diagnostics["warnings"] == []


def test_the_same_recording_gives_the_same_trajectory_whatever_the_threads(scans):
    one, two = (estimate_trajectory(sequence_of(scans), REFINED, workers=n) for n in (1, 3))
    np.testing.assert_array_equal(one.T_world_sensor, two.T_world_sensor)
    np.testing.assert_array_equal(one.T_level_world, two.T_level_world)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_short_recordings_have_trajectories(scans, n):
    trajectory = estimate_trajectory(sequence_of(scans[:n]), REFINED)
    assert len(trajectory) == n
    assert worst_distance(trajectory.T_world_sensor, TRUTH[:n]) < 0.25
    assert np.isfinite(trajectory.sweep_motion).all()


def test_a_lag_longer_than_the_recording_gives_its_poses_to_the_last_bit(scans):
    sequence, settings = sequence_of([untimed(s) for s in scans]), OdometrySettings()
    whole, so_far = estimate_trajectory(sequence, settings), PosesSoFar()
    with ThreadPoolExecutor(2) as pool:
        odometry = Odometry(settings, pool, lag=60.0)
        for scan, stamp in zip(sequence, sequence.stamps, strict=True):
            so_far.add(odometry.push(replace(scan, stamp=float(stamp))))
        so_far.add(odometry.finish())
    np.testing.assert_array_equal(np.array(list(so_far.poses.values())), whole.T_world_sensor)
    assert odometry.path.timing == whole.timing


def test_empty_scans_are_bridged_and_said(scans):
    holed = [EMPTY if i in (8, 9) else scan for i, scan in enumerate(scans)]
    trajectory = estimate_trajectory(sequence_of(holed), REFINED)
    assert worst_distance(trajectory.T_world_sensor, TRUTH) < 0.08
    (warning,) = trajectory.diagnostics["warnings"]
    assert "scans with too few points to register: 2 (first: 000008)" in warning


def test_a_recording_without_any_point_stands_still_and_says_why():
    trajectory = estimate_trajectory(sequence_of([EMPTY] * 3), OdometrySettings())
    np.testing.assert_array_equal(trajectory.T_world_sensor, np.tile(np.eye(4), (3, 1, 1)))
    assert [w.split()[0] for w in trajectory.diagnostics["warnings"]] == ["scans", "no"]


def test_a_recording_turned_round_goes_back_the_way_it_came(scans):
    back = [untimed(scan) for scan in reversed(scans)]
    back = [Scan(scan.points, stamp=SCAN_GAP * i) for i, scan in enumerate(back)]
    trajectory = estimate_trajectory(sequence_of(back), OdometrySettings())
    assert worst_distance(trajectory.T_world_sensor, np.linalg.inv(TRUTH[-1]) @ TRUTH[::-1]) < 0.05


def test_half_the_scans_are_enough(scans):
    settings = OdometrySettings(time="file")
    trajectory = estimate_trajectory(sequence_of(scans[::2], 2 * SCAN_GAP * np.arange(N // 2)), settings)
    assert trajectory.timing.share == pytest.approx(0.5, abs=0.01)
    assert worst_distance(trajectory.T_world_sensor, TRUTH[::2]) < 0.06


def test_a_pause_in_the_recording_is_bridged(scans):
    kept = [*range(8), *range(11, N)]
    trajectory = estimate_trajectory(sequence_of([scans[i] for i in kept], SCAN_GAP * np.array(kept)), REFINED)
    assert worst_distance(trajectory.T_world_sensor, TRUTH[kept]) < 0.06


def test_poses_given_are_kept_and_still_compensate_and_level(scans):
    elsewhere = np.linalg.inv(TRUTH[3])  # any world will do: the first scan's frame becomes the world
    trajectory = estimate_trajectory(sequence_of(scans), REFINED, poses=elsewhere @ TRUTH)
    np.testing.assert_allclose(trajectory.T_world_sensor, TRUTH, atol=1e-9)
    np.testing.assert_allclose(trajectory.sweep_motion[:, 0], 0.7, atol=0.01)
    assert trajectory.T_level_world[2, 3] == pytest.approx(1.8, abs=0.03)


def test_poses_that_do_not_suit_the_scans_are_warned_of(scans):
    wrong = TRUTH.copy()
    wrong[:, :3, 3] *= 1.05  # 35 cm in a second
    trajectory = estimate_trajectory(sequence_of(scans), REFINED, poses=wrong)
    assert "scans a second apart do not align with each other" in trajectory.diagnostics["warnings"][0]


def test_too_few_poses_are_refused(scans):
    with pytest.raises(InputError, match=r"poses must be \(20, 4, 4\), one per scan, got shape \(19, 4, 4\)"):
        estimate_trajectory(sequence_of(scans), REFINED, poses=TRUTH[:-1])


def test_a_pose_that_is_nowhere_is_refused_by_its_number(scans):
    poses = TRUTH.copy()
    poses[3:, 0, 3] = 1e300
    with pytest.raises(InputError, match="pose 3 is not on Earth"):
        estimate_trajectory(sequence_of(scans), REFINED, poses=poses)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("factor", [1.1, np.nan, 1e200])
def test_a_pose_that_is_no_rigid_transform_is_refused_by_its_number(scans, factor):
    poses = TRUTH.copy()
    poses[7, :3, :3] *= factor
    with pytest.raises(InputError, match="pose 7 is not a rigid transform"):
        estimate_trajectory(sequence_of(scans), REFINED, poses=poses)


def test_a_recording_of_no_scans_is_refused():
    with pytest.raises(InputError, match="drive holds no scans"):
        estimate_trajectory(sequence_of([]), OdometrySettings())


def test_progress_reaches_the_end(scans):
    seen = []
    estimate_trajectory(sequence_of(scans[:5]), REFINED, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(i, 5) for i in range(1, 6)]


def test_poses_that_nobody_can_drive_are_doubted_at_the_scan_where_they_leap():
    figures = {"wall_thickness_m": 0.01, "baseline_disagreement_m": 0.01}
    leap = {"greatest_acceleration_m_s2": 20.0, "greatest_acceleration_at": "000030"}
    assert doubts(figures | {"greatest_acceleration_m_s2": 7.0}, OdometrySettings()) == []
    (warning,) = doubts(figures | leap, OdometrySettings())
    assert "000030" in warning
    assert "do not trust the labels" in warning
