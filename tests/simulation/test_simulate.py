"""Simulated sequences as their users see them."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from automos import simulation
from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.labels import Label
from automos.simulation import scenarios
from automos.simulation import sequence as sequences


def forget() -> None:
    """Drop all that the simulator remembers."""
    for cache in (scenarios.build_world, sequences._world, sequences._cast, sequences._caster, sequences._verdicts):
        cache.cache_clear()


@pytest.fixture(scope="module")
def street():
    return simulation.simulate("canyon", "VLP-16", n_scans=12, seed=4)


def test_unknown_names_are_listed():
    with pytest.raises(InputError, match=r"scenario 'citty' is unknown \(did you mean city\?\); choose one of: city, "):
        simulation.simulate("citty")
    with pytest.raises(InputError, match=r"sensor 'HDL-65E' is unknown .*VLP-16"):
        simulation.simulate("city", "HDL-65E")


@pytest.mark.parametrize(
    ("n_scans", "seed", "message"),
    [(0, 0, "n_scans is 0"), (-3, 0, "n_scans is -3"), (10**20, 0, "has 1 to 1,000,000"), (1, -1, "seed is -1")],
)
def test_lengths_and_seeds_out_of_range_are_refused(n_scans, seed, message):
    with pytest.raises(InputError, match=message):
        simulation.simulate("city", "VLP-16", n_scans, seed)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_world(street):
    scan, truth = street[5], street.truth(5)
    forget()
    again = simulation.simulate("canyon", "VLP-16", n_scans=12, seed=4)
    assert again[5].points.tobytes() == scan.points.tobytes()
    assert again[5].intensity.tobytes() == scan.intensity.tobytes()
    assert np.array_equal(again.truth(5), truth)
    other = simulation.simulate("canyon", "VLP-16", n_scans=12, seed=5)
    assert len(other[5]) != len(scan) or not np.array_equal(other[5].points, scan.points)


def test_another_process_gives_the_same_bytes(street):
    code = (
        "import hashlib; from automos import simulation; q = simulation.simulate('canyon', 'VLP-16', 12, 4); "
        "print(hashlib.sha256(q[5].points.tobytes() + q.truth(5).tobytes()).hexdigest())"
    )
    import hashlib

    here = hashlib.sha256(street[5].points.tobytes() + street.truth(5).tobytes()).hexdigest()
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert there == here


def test_a_shorter_run_begins_like_a_longer_one(street):
    short = simulation.simulate("canyon", "VLP-16", n_scans=6, seed=4)
    assert short[5].points.tobytes() == street[5].points.tobytes()


def test_a_sequence_is_small_when_pickled_and_equal_when_back(street):
    packed = pickle.dumps(street)
    back = pickle.loads(packed)
    assert len(packed) < 1000
    assert back == street
    assert np.array_equal(back[3].points, street[3].points)
    assert back.fingerprint() == street.fingerprint()


def test_it_has_what_a_sequence_has(street):
    scan = street[0]
    assert len(street) == len(street.names) == len(street.stamps) == 12
    assert np.diff(street.stamps) == pytest.approx(0.1)
    assert scan.stamp == street.stamps[0] == pytest.approx(0.05)
    assert scan.ring is not None
    assert scan.ring.max() == 15
    assert scan.time is not None
    assert 0.0 <= scan.time.min() <= scan.time.max() < 0.1
    assert scan.intensity is not None
    assert 0.0 <= scan.intensity.min() <= scan.intensity.max() <= 1.0
    assert street.reference_poses.shape == (12, 4, 4)
    assert street.reference_poses[0] == pytest.approx(np.eye(4))
    assert not street.is_compensated
    assert np.array_equal(street[-1].points, street[11].points)
    with pytest.raises(IndexError):
        street[12]


def test_compensated_scans_are_the_raw_ones_seen_from_mid_sweep(street):
    still = simulation.simulate("canyon", "VLP-16", 12, 4, compensated=True)
    raw, flat = street[6], still[6]
    assert still.is_compensated
    assert np.array_equal(raw.ring, flat.ring)
    # What the sensor travels from its pose at a point's time to mid-sweep is what moves the point.
    time = street.stamps[6] + (raw.time - 0.05).astype(np.float64)
    T_site_sensor = street._T_site_sensor(time)
    T = inverse(street._T_site_sensor(street.stamps[6])) @ T_site_sensor
    expected = np.einsum("nij,nj->ni", T[:, :3, :3], raw.points.astype(np.float64)) + T[:, :3, 3]
    assert np.abs(flat.points - expected).max() < 2e-4
    assert np.abs(flat.points - raw.points).max() > 0.1


def test_poses_stack_still_points_onto_each_other(street):
    still = simulation.simulate("canyon", "VLP-16", 12, 4, compensated=True)
    clouds = []
    for k in (2, 9):
        label = still.truth(k) & 0xFFFF
        clouds.append(transform(still.reference_poses[k], still[k].points[label == Label.STATIC].astype(np.float64)))
    from scipy.spatial import cKDTree

    near = np.linalg.norm(clouds[0] - still.reference_poses[2][:3, 3], axis=1) < 15.0
    apart, _ = cKDTree(clouds[1]).query(clouds[0][near])
    assert np.median(apart) < 0.2  # rings of 16 beams do not fall onto each other, surfaces do


def test_the_level_frame_has_the_ground_at_zero_under_the_first_scan(street):
    T = street.T_level_world
    scan = street[0]
    points = transform(T @ street.reference_poses[0], scan.points.astype(np.float64))
    under = np.hypot(points[:, 0], points[:, 1]) < 8.0
    assert np.percentile(points[under & ((street.truth(0) & 0xFFFF) == Label.STATIC), 2], 20) == pytest.approx(
        0.0, abs=0.12
    )
    assert T[2, 3] == pytest.approx(street.sensor.height, abs=0.1)


def test_organised_sensors_keep_missing_returns_as_unlabeled_zeros():
    ouster = simulation.simulate("canyon", "OS1-64", 2, 4)
    scan, truth = ouster[1], ouster.truth(1)
    missing = ~scan.is_valid
    assert len(scan) == 64 * 1024
    assert np.array_equal(scan.ring, np.repeat(np.arange(64), 1024))
    assert missing.any()
    assert np.all(truth[missing] == Label.UNLABELED)


def test_points_on_the_ego_itself_are_unlabeled():
    ouster = simulation.simulate("canyon", "HDL-32E", 2, 4)
    own = np.linalg.norm(ouster[1].points, axis=1) < 1.2
    assert own.any()
    assert np.all((ouster.truth(1)[own] & 0xFFFF) == Label.UNLABELED)


def test_moving_now_is_part_of_moving_at_some_time():
    waiting = simulation.simulate("waiting", "VLP-16", 100, 0)
    found_waiting = 0
    for k in (0, 50, 99):
        ever, now = waiting.truth(k) & 0xFFFF, waiting.truth_now(k) & 0xFFFF
        assert not np.any((now == Label.MOVING) & (ever == Label.STATIC))
        found_waiting += int(np.count_nonzero((ever == Label.MOVING) & (now == Label.STATIC)))
    assert found_waiting > 100  # cars at the lights
