import numpy as np
import pytest
from raw_worlds import TOWN, curve, sweep, true_poses, worst_distance
from worlds import SCAN_GAP, record, van

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import inverse
from automos.core.scan import Scan
from automos.odometry.kiss import find_start, register_scans
from automos.odometry.motion import chain
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings
from automos.simulation import simulate

SETTINGS = OdometrySettings(voxel=0.5)  # the town is small
TIMED = SweepTiming("file", duration=SCAN_GAP, share=1.0)
N = 14
POSE = curve(6.0, 0.15)
EMPTY = Scan(np.zeros((0, 3), np.float32))


@pytest.fixture(scope="module")
def scans():
    return [sweep(TOWN, POSE, SCAN_GAP * i, n_beams=40) for i in range(N)]


def register(scans, gaps=None):
    found = list(
        register_scans(ArraySequence(scans), SETTINGS, TIMED, np.ones(len(scans) - 1) if gaps is None else gaps)
    )
    return chain(np.eye(4), np.array([scan.T_last_this for scan in found[1:]])), found


def test_poses_are_the_sensors_at_mid_sweep_from_the_first_scan_on(scans):
    poses, found = register(scans)
    truth = true_poses(POSE, N)
    assert all(scan.is_registered for scan in found)
    steps, true_steps = (np.linalg.norm(np.diff(p[:, :3, 3], axis=0), axis=1) for p in (poses, truth))
    assert np.abs(steps - true_steps).max() < 0.12  # 0.6 m each; a first scan left bent is off by half a step
    assert worst_distance(poses, truth) < 0.04 * 0.6 * N


def test_the_environment_does_not_change_the_poses(scans, monkeypatch):
    before, _ = register(scans[:6])
    monkeypatch.setenv("kiss_icp_data", '{"max_range": 8.0, "deskew": true}')
    monkeypatch.setenv("kiss_icp_mapping", '{"voxel_size": 5.0}')
    monkeypatch.setenv("kiss_icp_adaptive_threshold", '{"initial_threshold": 0.01}')
    after, _ = register(scans[:6])
    np.testing.assert_array_equal(before, after)


def test_the_same_scans_give_the_same_poses(scans):
    np.testing.assert_array_equal(register(scans)[0], register(scans)[0])


def test_scans_without_points_hold_the_motion(scans):
    holed = [EMPTY if i in (7, 8) else scan for i, scan in enumerate(scans)]
    poses, found = register(holed)
    assert [i for i, scan in enumerate(found) if not scan.is_registered] == [7, 8]
    np.testing.assert_allclose(found[8].T_last_this, found[7].T_last_this, atol=1e-9)
    assert worst_distance(poses, true_poses(POSE, N)) < 0.04 * 0.6 * N


def test_missing_scans_are_bridged_by_the_motion_seen(scans):
    kept = [*range(7), *range(10, N)]
    gaps = np.diff(kept).astype(float)
    poses, _ = register([scans[i] for i in kept], gaps)
    assert worst_distance(poses, true_poses(POSE, N)[kept]) < 0.04 * 0.6 * N


def test_a_recording_of_nothing_stays_where_it_is():
    poses, found = register([EMPTY] * 4)
    np.testing.assert_allclose(poses, np.tile(np.eye(4), (4, 1, 1)), atol=1e-12)
    assert not any(scan.is_registered for scan in found)


def test_invalid_points_are_left_out(scans):
    spoilt = Scan(np.concatenate([np.full((9, 3), np.nan, np.float32), scans[0].points]),
                  time=np.concatenate([np.zeros(9, np.float32), scans[0].time]))  # fmt: skip
    first = register([spoilt, *scans[1:4]])[1][0]
    assert len(first.points) <= len(scans[0])
    assert np.isfinite(first.points).all()


@pytest.mark.parametrize("heading", [1.0, -1.0], ids=["forwards", "backwards"])
def test_a_start_in_full_flight_is_found(heading):
    n, speed = 12, 23.0
    pose = curve(heading * speed, 0.0)
    world = record(TOWN, np.array([pose(SCAN_GAP * i) for i in range(n)]), n_beams=40)
    found = register_scans(world.sequence, OdometrySettings(), SweepTiming(), np.ones(n - 1))
    steps = np.array([scan.T_last_this[0, 3] for scan in found][1:])
    np.testing.assert_allclose(steps, heading * SCAN_GAP * speed, atol=0.1)


def test_a_vehicle_that_stands_stays_whatever_is_tried():
    n = 12
    world = record((*TOWN, van(0.0, 3.0, 0.0, 9.0), van(14.0, -3.0, np.pi, 9.0)), np.array([curve(0.0, 0.0)(0.0)] * n))
    found = register_scans(world.sequence, OdometrySettings(), SweepTiming(), np.ones(n - 1))
    assert max(np.linalg.norm(scan.T_last_this[:3, 3]) for scan in found) < 0.05


def test_a_standstill_amid_traffic_that_landmarks_contradict_is_none():
    drive = simulate("motorway", "VLP-16", n_scans=10, seed=1)  # 28 m/s, most of what is seen keeps pace
    scans = [drive[i] for i in range(10)]
    timing = SweepTiming("file", duration=SCAN_GAP, share=1.0)
    start = find_start(scans, OdometrySettings(), timing, np.ones(9))
    true = inverse(drive.reference_poses[0]) @ drive.reference_poses[1]
    np.testing.assert_allclose(start[:2], true[:2, 3], atol=0.2)
