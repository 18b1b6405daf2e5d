from itertools import pairwise

import numpy as np
import pytest
from raw_worlds import TOWN, curve, sweep, true_poses, worst_distance
from worlds import record, street

from automos import load_settings
from automos.core.geometry import inverse
from automos.core.scan import Scan
from automos.odometry import path
from automos.odometry.followed import TimedScan
from automos.odometry.links import Alignment
from automos.odometry.path import FREE, Path
from automos.odometry.settling import at_another_speed
from automos.odometry.sweep_timing import SweepTiming

SETTINGS = load_settings("default").odometry


def pushed(scans, **kwargs):
    """Return the odometry after `scans`, ten a second, and the poses that it gave after each."""
    odometry, seen = Path(SETTINGS, SweepTiming(), **kwargs), []
    for k, scan in enumerate(scans):
        odometry.push(TimedScan(lambda scan=scan: scan, 0.1 * k, 1.0 if k else 0.0, 0.1))
        seen.append(odometry.poses)
    return odometry, seen


def test_poses_are_refined_for_a_while_and_then_final():
    _, seen = pushed(street(26).sequence)
    n_free = round(FREE / 0.1)
    stamp = 0.1 * 5
    changes = [np.abs(after[stamp] - before[stamp]).max() for before, after in pairwise(seen[5:])]
    assert max(changes[: n_free - 1]) > 0.0
    assert max(changes[n_free:]) == 0.0


def test_the_window_holds_what_the_longest_lag_needs_and_no_more():
    odometry, _ = pushed(street(45).sequence)
    assert len(odometry.poses) == round((FREE + max(Alignment().lags) + Alignment().submap_every) / 0.1)


def test_a_path_begins_where_it_is_told_to():
    world = street(12)
    T_first = np.array([[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, -2.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    here, there = pushed(world.sequence)[0], pushed(world.sequence, T_world_first=T_first)[0]
    np.testing.assert_allclose(there.T_world_sensor, T_first @ here.T_world_sensor, atol=2e-3)


def test_a_scan_without_points_goes_on_as_the_sensor_did():
    world = street(14)
    scans = [*list(world.sequence)[:12], Scan(np.zeros((3, 3), np.float32)), world.sequence[13]]
    odometry, _ = pushed(scans)
    steps = inverse(np.array(list(odometry.poses.values()))[:-1]) @ np.array(list(odometry.poses.values()))[1:]
    np.testing.assert_allclose(
        steps[-2:, :3, 3], (inverse(world.poses[11:13]) @ world.poses[12:14])[:, :3, 3], atol=0.05
    )


def test_a_search_for_the_speed_changes_nothing_where_it_is_right():
    odometry, _ = pushed(street(16).sequence)
    assert at_another_speed(odometry.window, SETTINGS, {}) is None


N = 55


@pytest.fixture
def short_windows(monkeypatch):
    monkeypatch.setattr(path, "WINDOW", 0.4)


@pytest.fixture(scope="module")
def drive():
    pose = curve(5.0, 0.1)
    return record(TOWN, np.array([pose(0.1 * i) for i in range(N)])).sequence, true_poses(pose, N)


def every_pose(scans, **kwargs):
    """Return the (N, 4, 4) poses of `scans`, each as it was refined last, and the path."""
    odometry, seen = pushed(scans, **kwargs)
    odometry.finish()
    found = {}
    for poses in [*seen, odometry.poses]:
        found |= poses
    return np.array(list(found.values())), odometry


@pytest.mark.usefixtures("short_windows")
def test_windows_refine_as_well_as_the_whole(drive):
    scans, truth = drive
    poses, odometry = every_pose(scans, lag=np.inf)
    assert len(odometry.consistency) >= 2
    assert worst_distance(poses, truth) < 0.03


@pytest.mark.usefixtures("short_windows")
def test_no_step_jumps_where_windows_meet(drive):
    scans, truth = drive
    poses, _ = every_pose(scans, lag=np.inf)
    steps, true_steps = (np.linalg.norm(np.diff(p[:, :3, 3], axis=0), axis=1) for p in (poses, truth))
    np.testing.assert_allclose(steps, true_steps, atol=0.015)


@pytest.mark.usefixtures("short_windows")
def test_no_more_than_a_window_of_scans_is_kept(drive):
    odometry, _ = pushed(drive[0], lag=np.inf)
    assert len(odometry.poses) <= round((path.WINDOW + FREE + max(Alignment().lags) + 0.5) / 0.1)


def test_a_lag_longer_than_the_drive_is_as_good_as_none_to_the_last_bit(drive):
    here, there = (every_pose(drive[0], lag=lag)[0] for lag in (0.1 * N + FREE + 1.0, np.inf))
    np.testing.assert_array_equal(here, there)


def test_scans_that_are_missing_are_counted_where_nothing_is_stamped(drive):
    scans, truth = drive
    kept = [i for i in range(N) if i not in (20, 21)]
    poses, odometry = every_pose([scans[i] for i in kept], lag=np.inf, has_stamps=False)
    assert list(odometry.missing.values()) == [3.0]
    assert worst_distance(poses, truth[kept]) < 0.03


@pytest.mark.parametrize("lost", [range(9, 11), range(9, 13)])
def test_a_sensor_that_turns_while_scans_are_lost_is_found_again_at_once(lost):
    pose, kept = curve(1.5, 1.5), [i for i in range(18) if i not in lost]
    odometry = Path(SETTINGS, SweepTiming("file", duration=0.1, share=1.0), has_stamps=False)
    for k, i in enumerate(kept):
        scan = sweep(TOWN, pose, 0.1 * i, n_beams=32)
        odometry.push(TimedScan(lambda scan=scan: scan, 0.1 * k, 1.0 if k else 0.0, 0.1))
        if i == lost.stop:
            assert odometry.window.gaps[-1] == len(lost) + 1
    assert worst_distance(odometry.window.T_world_sensor, true_poses(pose, 18)[kept]) < 0.02
