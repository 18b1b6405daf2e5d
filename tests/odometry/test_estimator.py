from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from raw_worlds import TOWN, curve, sweep, untimed
from worlds import SCAN_GAP, SENSOR_HEIGHT, street
from worlds import record as record_compensated

from automos import load_settings
from automos.core.geometry import inverse, make_transform, se3_log
from automos.core.scan import Scan
from automos.odometry.background import BackgroundTask
from automos.odometry.correction import AT_ONCE
from automos.odometry.estimator import Odometry
from automos.odometry.sweep_timing import SweepTiming
from automos.simulation import Convention, record, simulate

SETTINGS = load_settings("default").odometry


@pytest.fixture(scope="module")
def city():
    """Return six seconds of raw sweeps."""
    return list(simulate("city", "VLP-16", n_scans=60, seed=8))


def follow(scans, settings=SETTINGS, **kwargs):
    with ThreadPoolExecutor(1) as pool:
        odometry = Odometry(settings, pool, **kwargs)
        return [odometry.push(scan) for scan in scans]


def chained(moved):
    """Return (N, 4, 4) poses in the last world, each as it was refined last."""
    poses = {}
    for step in moved:
        if step.T_before_now is not None:
            poses = {stamp: inverse(step.T_before_now) @ T for stamp, T in poses.items()}
        poses |= {came.stamp: posed.T_world_sensor for came, posed in step.again if step.T_before_now is not None}
        poses |= step.refined
    return np.array([poses[step.stamp] for step in moved])


def test_a_slow_drive_is_found_though_rings_lie_on_rings_at_rest():
    world = street(20)
    error = se3_log(inverse(world.poses) @ chained(follow(world.sequence, is_compensated=True)))
    assert np.linalg.norm(error[:, :3], axis=1).max() < 0.03
    assert np.degrees(np.linalg.norm(error[:, 3:], axis=1)).max() < 0.1


def test_a_start_in_full_flight_is_found():
    world = simulate("avenue", "VLP-16", n_scans=26, seed=5)
    moved = follow([Scan(scan.points, stamp=scan.stamp) for scan in world], timing=SweepTiming())
    true = np.linalg.norm(np.diff(world.reference_poses[-3:, :3, 3], axis=0), axis=1)
    assert true.min() > 0.8  # metres a scan
    found = np.linalg.norm(np.diff(chained(moved)[-3:, :3, 3], axis=0), axis=1)
    np.testing.assert_allclose(found, true, rtol=0.1)


@pytest.mark.parametrize("seed", [757, pytest.param(782, marks=pytest.mark.slow)])
def test_a_start_is_told_from_rest_though_rings_of_ground_lie_on_rings(seed):
    world = simulate("hills", "VLP-16", n_scans=14, seed=seed)
    moved = follow([world[k] for k in range(5)])
    true = np.linalg.norm(np.diff(world.reference_poses[2:5, :3, 3], axis=0), axis=1)
    assert true.min() > 0.8  # metres a scan
    found = np.linalg.norm(np.diff(chained(moved)[2:5, :3, 3], axis=0), axis=1)
    np.testing.assert_allclose(found, true, atol=0.15)


@pytest.mark.parametrize(
    ("seed", "most"), [(0, 30), *(pytest.param(*few, marks=pytest.mark.slow) for few in ((1, 12), (3, 60)))]
)
def test_however_many_scans_are_lost_the_others_are_followed(city, seed, most):
    """As on a robot that is too slow: whatever was sought in the background fits what is there when it is found."""
    there = [scan.points for scan in city[:40]]
    numbers = np.cumsum(np.random.default_rng(seed).integers(1, most, 25))
    to_and_fro = [there[min(k % 80, 79 - k % 80)] for k in numbers.tolist()]
    scans = [Scan(points, stamp=0.1 * k) for points, k in zip(to_and_fro, numbers, strict=True)]
    assert len(follow(scans, lag=0.0)) == len(scans)


@pytest.fixture(scope="module")
def sweeps(city):
    """Return raw sweeps that begin on the right, whose points have no times, and an order that tells none."""
    rng, turned = np.random.default_rng(0), []
    for scan in city:
        x, y, z = rng.permutation(scan.points).T
        turned.append(Scan(np.stack([-y, x, z], axis=1), stamp=scan.stamp))
    return turned


def test_timing_is_taken_over_once_the_last_scans_were_followed_under_it(sweeps):
    moved = follow(sweeps)
    seams = [step.posed.timing.seam_deg for step in moved]
    guessed, known = (i for i, step in enumerate(moved) if step.T_before_now is not None)
    assert seams[1:known] == (known - 1) * [180.0]  # the most usual one
    assert seams[known:] == (len(moved) - known) * [-90.0]
    again = [pair for step in moved[guessed + 1 :] for pair in step.again]
    assert [came.stamp for came, _ in again] == [scan.stamp for scan in sweeps[:known]][-len(again) :]
    assert {posed.timing.seam_deg for _, posed in again} == {-90.0}
    assert max(len(step.again) for step in moved) == AT_ONCE
    # the sensor does not leap: the first scan on the new path lies where the last one and the motion want it
    steps = np.linalg.norm(np.diff(chained(moved)[:, :3, 3], axis=0), axis=1)
    assert steps[known - 1] == pytest.approx(steps[known], abs=0.1)


STANDING = 20  # scans


def setting_off(now):
    """Return the pose of a sensor that sets off after `STANDING` scans, at 3 m/s^2."""
    x = -8.0 + 1.5 * max(now - SCAN_GAP * STANDING, 0.0) ** 2
    return make_transform(t=[x, 0.0, SENSOR_HEIGHT])


@pytest.mark.parametrize(
    ("pose", "at", "is_raw"),
    [
        (setting_off, STANDING + 24, True),
        pytest.param(setting_off, STANDING + 24, False, marks=pytest.mark.slow),
        pytest.param(curve(5.0, 0.3), 24, True, marks=pytest.mark.slow),
        (curve(5.0, 0.3), 24, False),
    ],
    ids=["raw from rest", "compensated from rest", "raw in motion", "compensated in motion"],
)
def test_the_timing_is_known_soon_after_the_sensor_moves_and_never_changes_back(pose, at, is_raw):
    middles = SCAN_GAP * np.arange(at + 12)
    if is_raw:
        scans = [sweep(TOWN, pose, middle, n_beams=40) for middle in middles]
    else:
        scans = record_compensated(TOWN, np.array([pose(middle) for middle in middles]), n_beams=40).sequence
    moved = follow([untimed(scan) for scan in scans])
    kinds = [step.posed.timing.source for step in moved]
    assert len(set(kinds[1 : STANDING if pose is setting_off else 2])) == 1  # what is usual, while nothing tells
    assert all((kind != "none") == is_raw for kind in kinds[at:])
    assert sum(a != b for a, b in pairwise(kinds[1:])) == (not is_raw)


def test_the_first_sweep_is_compensated_once_the_motion_is_known():
    world = simulate("avenue", "VLP-16", n_scans=8, seed=5)
    moved = follow([Scan(scan.points, stamp=scan.stamp) for scan in world])
    true = np.linalg.norm(np.diff(world.reference_poses[:, :3, 3], axis=0), axis=1)
    assert true.min() > 1.0  # metres a scan
    found = np.linalg.norm(np.diff(chained(moved)[:, :3, 3], axis=0), axis=1)
    np.testing.assert_allclose(found[2:], true[2:], atol=0.04)  # uncompensated: a tenth too long, for seconds


def test_the_order_of_the_points_times_the_second_scan():
    world = record("city", "VLP-16", 6, seed=3, convention=Convention(turns=1.09, order="time"))
    moved = follow([Scan(scan.points, stamp=scan.stamp) for scan in world])
    assert [step.posed.timing.source for step in moved] == ["none"] + (len(moved) - 1) * ["order"]


def test_a_sweep_of_half_the_time_between_scans_is_known_to_be_one_from_the_second_on():
    """Recorded times of 50 ms per scan, ten scans per second."""
    pose, scans = curve(6.0, 0.0), []
    for k in range(48):
        middle = SCAN_GAP * k
        scan = sweep(TOWN, lambda now, middle=middle: pose(0.5 * (middle + now)), middle)  # twice as fast
        scans.append(replace(scan, time=0.5 * scan.time))
    shares = [step.posed.timing.share for step in follow(scans)]
    assert shares[1:] == (len(shares) - 1) * [pytest.approx(0.5, abs=0.01)]


@pytest.mark.parametrize(("time", "source"), [("azimuth", "azimuth"), ("order", "order"), ("auto", "file")])
def test_recorded_times_are_not_used_where_the_settings_name_others(time, source):
    world = record("city", "VLP-16", 6, seed=3, convention=Convention(turns=1.0, order="time"))
    scans = [replace(scan, time=np.linspace(0.0, 0.1, len(scan), dtype=np.float32)) for scan in world]
    moved = follow(scans, settings=load_settings("default", None, {"odometry.time": time}).odometry)
    assert moved[-1].posed.timing.source == source


def test_an_answer_never_comes_sooner_however_fast_it_was_found():
    task = BackgroundTask(ThreadPoolExecutor(1), 2.0)
    assert task.result(100.0) is None
    task.start(lambda: "first", 5.0)
    task.start(lambda: "second", 6.0)  # one is enough
    assert task.result(7.0 - 0.01) is None
    assert task.result(7.0) == task.result(100.0) == "first"


def test_who_brakes_hard_is_not_held_to_the_speed_that_he_had():
    world = simulate("scooters", "VLP-16", n_scans=12, seed=4)
    moved = follow([Scan(scan.points, stamp=scan.stamp) for scan in world])
    true = np.linalg.norm(np.diff(world.reference_poses[:, :3, 3], axis=0), axis=1)
    assert np.mean(-np.diff(true)) > 0.03  # metres a scan and scan: 3 m/s^2 all the time, among traffic
    found = np.linalg.norm(np.diff(chained(moved)[:, :3, 3], axis=0), axis=1)
    np.testing.assert_allclose(found[3:], true[3:], atol=0.05)
