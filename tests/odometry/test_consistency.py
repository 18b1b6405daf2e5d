import numpy as np
import pytest
from raw_worlds import TOWN, curve, true_poses
from worlds import record

from automos.odometry.clock import read_clock
from automos.odometry.consistency import can_be_driven, doubts, greatest_acceleration, measure_consistency, summarize
from automos.odometry.motion import SweepTiming
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()
N = 26


@pytest.fixture(scope="module")
def drive():
    pose = curve(6.0, 0.1)
    return record(TOWN, np.array([pose(0.1 * i) for i in range(N)])).sequence, true_poses(pose, N)


def figures(drive, poses):
    sequence, _ = drive
    links = measure_consistency(sequence, poses, SweepTiming(), read_clock(sequence), SETTINGS)
    return summarize(links)


def test_walls_are_thin_with_the_right_poses(drive):
    right = figures(drive, drive[1])
    assert right["wall_thickness_m"] < 0.03
    assert right["baseline_disagreement_m"] < 0.02


def test_walls_thicken_and_baselines_disagree_with_drift_sideways(drive):
    poses = drive[1].copy()
    poses[:, 1, 3] += 0.02 * np.arange(N)  # 0.2 m in a second
    wrong = figures(drive, poses)
    assert wrong["wall_thickness_m"] > 2.0 * figures(drive, drive[1])["wall_thickness_m"]
    assert wrong["baseline_disagreement_m"] == pytest.approx(0.2, abs=0.06)
    assert wrong["baseline_disagreement_percent"] == pytest.approx(100 * 0.2 / 6.0, abs=1.5)


def test_a_recording_of_one_scan_has_no_figures(drive):
    sequence, _ = drive
    single = type(sequence)([sequence[0]])
    links = measure_consistency(single, np.eye(4)[None], SweepTiming(), read_clock(single), SETTINGS)
    assert set(summarize(links).values()) == {None}


def driven(speeds, dt=0.1):
    """Poses of a straight drive at `speeds` (N,) m/s, and their times."""
    T = np.tile(np.eye(4), (len(speeds), 1, 1))
    T[1:, 0, 3] = np.cumsum(dt * 0.5 * (np.array(speeds[1:]) + speeds[:-1]))
    return T, dt * np.arange(len(speeds))


def test_the_greatest_acceleration_is_that_of_the_hardest_half_second():
    braking = [20.0] * 20 + [20.0 - 0.7 * k for k in range(1, 21)] + [6.0] * 20
    found, at = greatest_acceleration(*driven(braking))
    assert found == pytest.approx(7.0, abs=0.1)
    assert 20 <= at <= 40
    assert can_be_driven(*driven(braking))


def test_one_step_that_is_off_is_noise_and_a_speed_that_leaps_is_not():
    T, times = driven([10.0] * 60)
    T[30:, 0, 3] += 0.2
    assert can_be_driven(T, times)
    assert not can_be_driven(*driven([0.0] * 30 + [10.0] * 30))


@pytest.mark.parametrize("n", [0, 1, 2, 5])
def test_too_few_scans_tell_no_acceleration(n):
    assert greatest_acceleration(*driven([0.0, 30.0, 0.0, 30.0, 0.0][:n]))[0] == 0.0


def test_poses_that_nobody_can_drive_are_doubted_at_the_scan_where_they_leap():
    figures = {"wall_thickness_m": 0.01, "baseline_disagreement_m": 0.01}
    leap = {"greatest_acceleration_m_s2": 20.0, "greatest_acceleration_at": "000030"}
    assert doubts(figures | {"greatest_acceleration_m_s2": 7.0}, OdometrySettings()) == []
    (warning,) = doubts(figures | leap, OdometrySettings())
    assert "000030" in warning
    assert "do not trust the labels" in warning
