import numpy as np
import pytest

from automos import ArraySequence
from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.core.scan import Scan
from automos.odometry.clock import read_clock
from automos.odometry.one_lidar import OneLidar, with_one_lidar
from automos.odometry.timing import choose_timing
from automos.settings import OdometrySettings
from automos.simulation import record

MOUNTS = np.stack([np.eye(4), make_transform(t=[2.0, 0.0, -1.0])])


def merged(n_scans=3):
    """Scans of two LiDARs, of which the second has two of three points."""
    points = np.array([[5, 0, 0], [7, 0, 0], [8, 1, 0]], np.float32)
    sensor = np.array([0, 1, 1], np.uint8)
    times = np.array([0.0, 0.05, 0.1], np.float32)
    scans = [Scan(points, time=times, sensor=sensor, T_scan_sensor=MOUNTS) for _ in range(n_scans)]
    return ArraySequence(scans, stamps=0.1 * np.arange(n_scans))


def test_a_recording_of_one_lidar_is_returned_as_it_is():
    sequence, poses = ArraySequence([np.ones((4, 3))]), np.eye(4)[None]
    assert with_one_lidar(sequence, poses) == (sequence, poses)


def test_the_lidar_with_most_points_is_a_recording_of_its_own():
    sequence = merged()
    poses = np.stack([make_transform(t=[k, 0.0, 0.0]) for k in range(3)])
    one, T_world_sensor = with_one_lidar(sequence, poses)
    assert isinstance(one, OneLidar)
    assert (len(one), one.names, one.is_compensated) == (3, sequence.names, sequence.is_compensated)
    np.testing.assert_array_equal(one.stamps, sequence.stamps)
    np.testing.assert_allclose(one[1].points, [[5, 0, 1], [6, 1, 1]])
    np.testing.assert_allclose(one[1].time, [0.05, 0.1])
    assert one[1].T_scan_sensor is None
    np.testing.assert_allclose(T_world_sensor[:, :3, 3], [[2, 0, -1], [3, 0, -1], [4, 0, -1]])


def test_merged_clouds_with_known_mounts_have_the_timing_of_their_lidars():
    one, two = (record("avenue", "VLP-16", 20, 0, n_lidars=n) for n in (1, 2))
    found = [
        choose_timing(drive, OdometrySettings(time="order"), drive.reference_poses, read_clock(drive)).timing
        for drive in (one, two)
    ]
    assert found[0].turn == found[1].turn
    assert found[1].source == "order"


def test_the_first_scan_and_missing_returns_do_not_decide_which_lidar_has_most_points():
    missing, hit = np.zeros((6, 3), np.float32), np.full((2, 3), 5.0, np.float32)
    sensor = np.array([0] * 6 + [1] * 2, np.uint8)
    scans = [Scan(np.vstack([missing, hit]), sensor=sensor, T_scan_sensor=MOUNTS) for _ in range(3)]
    scans[0] = Scan(np.zeros((0, 3)), sensor=np.zeros(0, np.uint8), T_scan_sensor=MOUNTS)
    one, _ = with_one_lidar(ArraySequence(scans), np.tile(np.eye(4), (3, 1, 1)))
    assert [len(scan) for scan in one] == [0, 2, 2]


def test_times_in_the_file_last_as_long_as_those_of_all_lidars():
    points, sensor = np.ones((5, 3), np.float32), np.array([0, 0, 0, 1, 1], np.uint8)
    times = np.array([0.0, 0.05, 0.1, 0.04, 0.14], np.float32)  # the second one begins later
    scans = [Scan(points, time=times, sensor=sensor, T_scan_sensor=MOUNTS)] * 3
    drive = ArraySequence(scans, stamps=0.1 * np.arange(3))
    timing = choose_timing(
        drive, OdometrySettings(time="file"), np.tile(np.eye(4), (3, 1, 1)), read_clock(drive)
    ).timing
    assert (timing.duration, timing.share) == (pytest.approx(0.14), pytest.approx(1.4))


def test_scans_of_a_recording_name_the_same_lidars():
    of_two = merged()[0]
    with pytest.raises(InputError, match="scan 1 is of 1 LiDARs, scan 0 of 2: name the same LiDARs in all scans"):
        ArraySequence([of_two, Scan(np.ones((4, 3)))])
