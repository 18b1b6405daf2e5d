import numpy as np
import pytest
from raw_worlds import TOWN, curve, true_poses
from worlds import record

from automos.odometry.clock import read_clock
from automos.odometry.links import measure_consistency, summarize
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings()
N = 26


@pytest.fixture(scope="module")
def drive():
    pose = curve(6.0, 0.1)
    return record(TOWN, np.array([pose(0.1 * i) for i in range(N)])).sequence, true_poses(pose, N)


def figures(sequence, poses):
    clock = read_clock(sequence)
    return summarize(measure_consistency(sequence, poses, SweepTiming(), clock.gaps, clock.period, SETTINGS))


def test_walls_are_thin_with_the_right_poses(drive):
    right = figures(drive[0], drive[1])
    assert right["wall_thickness_m"] < 0.03
    assert right["baseline_disagreement_m"] < 0.02


def test_walls_thicken_and_baselines_disagree_with_drift_sideways(drive):
    poses = drive[1].copy()
    poses[:, 1, 3] += 0.02 * np.arange(N)  # 0.2 m in a second
    wrong = figures(drive[0], poses)
    assert wrong["wall_thickness_m"] > 2.0 * figures(drive[0], drive[1])["wall_thickness_m"]
    assert wrong["baseline_disagreement_m"] == pytest.approx(0.2, abs=0.06)


def test_a_recording_of_one_scan_has_no_figures(drive):
    sequence, _ = drive
    single = type(sequence)([sequence[0]])
    assert set(figures(single, np.eye(4)[None]).values()) == {None}
