from itertools import pairwise

import numpy as np
from worlds import street

from automos import load_settings
from automos.core.geometry import inverse
from automos.core.scan import Scan
from automos.odometry.fixed_lag import ABOUT, FREE, FixedLag, TimedScan
from automos.odometry.sweep_timing import SweepTiming

SETTINGS = load_settings("default").odometry


def pushed(scans, **kwargs):
    """Return the odometry after `scans`, ten a second, and the poses that it gave after each."""
    odometry, seen = FixedLag(SETTINGS, SweepTiming(), **kwargs), []
    for k, scan in enumerate(scans):
        odometry.push(TimedScan(scan, 0.1 * k, 1.0 if k else 0.0, 0.1))
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
    assert len(odometry.poses) == round((FREE + max(ABOUT.lags) + ABOUT.submap_every) / 0.1)


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
    assert odometry.speed_search()() == {}
