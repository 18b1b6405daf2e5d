"""Speeds that leap as no vehicle's do, and the scans before registered backwards."""

import numpy as np
import pytest
from raw_worlds import TOWN, curve, sweep, true_poses
from worlds import SCAN_GAP

from automos.array_sequence import ArraySequence
from automos.geometry import inverse
from automos.odometry.clock import Clock
from automos.odometry.leaps import find_leaps, mend_leaps, replay
from automos.odometry.motion import SweepTiming
from automos.settings import OdometrySettings

SETTINGS = OdometrySettings(voxel=0.5)
TIMED = SweepTiming("file", duration=SCAN_GAP, share=1.0)


def clock_of(n, period=SCAN_GAP):
    return Clock(period * np.arange(n), period, np.ones(n - 1))


def steps_of(speeds, period=0.1):
    steps = np.tile(np.eye(4), (len(speeds), 1, 1))
    steps[:, 0, 3] = period * np.asarray(speeds)
    return steps


@pytest.mark.parametrize(
    ("speeds", "expected"),
    [
        (np.full(40, 9.0), []),
        (np.linspace(0.0, 12.0, 40), []),  # 3 m/s^2, a sporting start
        (np.r_[np.full(20, 14.0), np.linspace(14.0, 0.0, 20)], []),  # an emergency stop
        (np.r_[np.zeros(20), np.full(20, 9.0)], [25]),  # 9 m/s from one scan to the next
        (np.r_[np.zeros(20), np.full(20, 9.0), np.zeros(20), np.full(20, 9.0)], [25, 65]),
        (np.ones(3), []),
    ],
)
def test_leaps_are_rises_that_no_vehicle_makes(speeds, expected):
    found = find_leaps(steps_of(speeds), clock_of(len(speeds) + 1, 0.1))
    assert len(found) == len(expected)
    assert np.abs(np.array(found, int) - expected).max(initial=0) <= 3


@pytest.fixture(scope="module")
def drive():
    pose = curve(6.0, 0.15)
    poses = true_poses(pose, 24)
    return ArraySequence([sweep(TOWN, pose, SCAN_GAP * i, n_beams=40) for i in range(24)]), poses


def test_scans_before_a_leap_are_registered_backwards(drive):
    sequence, poses = drive
    true = inverse(poses[:-1]) @ poses[1:]
    stood = true.copy()
    stood[:10] = np.eye(4)  # as if the registration had stayed with the traffic
    mended = mend_leaps(sequence, stood, TIMED, clock_of(24), SETTINGS)
    assert np.abs(mended[:10, :3, 3] - true[:10, :3, 3]).max() < 0.12  # of 0.6 m
    np.testing.assert_array_equal(mended[19:], true[19:])  # well after the leap nothing is touched


def test_without_a_leap_nothing_is_done(drive):
    sequence, poses = drive
    steps = inverse(poses[:-1]) @ poses[1:]
    assert mend_leaps(sequence, steps, TIMED, clock_of(24), SETTINGS) is steps


def test_replayed_scans_are_compensated_for_the_given_steps(drive):
    sequence, poses = drive
    steps = inverse(poses[:-1]) @ poses[1:]
    scans = list(replay(sequence, steps, TIMED, clock_of(24), SETTINGS))
    np.testing.assert_array_equal(np.array([scan.T_last_this for scan in scans[1:]]), steps)
    still = list(replay(sequence, np.tile(np.eye(4), (23, 1, 1)), TIMED, clock_of(24), SETTINGS))
    shift = np.linalg.norm(scans[5].points - still[5].points, axis=1)
    assert 0.25 < shift.max() < 0.6  # half a step of 0.6 m, and half a turn of 0.015 rad seen from up to 40 m
