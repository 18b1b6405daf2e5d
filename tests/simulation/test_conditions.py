"""What carries the sensor, several sensors, air and bright signs: exact where a figure is known."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.label_files import OUTLIER, to_mos
from automos.core.labels import Label
from automos.simulation import Conditions, record, simulate
from automos.simulation.rigs import RIGS, Part, placed, ride_on, rigs
from automos.simulation.scenarios import build_world
from automos.simulation.traffic.driving import DT
from automos.simulation.traffic.motion import EgoMotion

ASKED = ("canyon", "OS1-64", 8, 4)


def on(n_lidars=1, **about):
    return record(*ASKED, conditions=Conditions(**about), n_lidars=n_lidars)


def ride(turn_rate: float, speed: float = 8.0, seconds: float = 60.0) -> EgoMotion:
    """Return the motion of a body that drives a circle (or straight on), m/s and radians a second."""
    time = np.arange(0.0, seconds, DT)
    yaw = turn_rate * time
    steps = speed * DT * np.column_stack([np.cos(yaw), np.sin(yaw)])
    xy = np.concatenate([[[0.0, 0.0]], np.cumsum(steps[:-1], axis=0)])
    return EgoMotion(np.column_stack([xy, 0 * time, yaw, 0 * time, 0 * time]))


def swing(part: Part, motion: EgoMotion, time: float) -> float:
    _, T = placed(part, motion, time)
    return float(np.arctan2(T[1, 0], T[0, 0]))


def test_a_trailer_follows_straight_and_swings_on_a_circle():
    trailer = Part((), hinge=-0.6, length=6.4)
    assert swing(trailer, ride(0.0), 50.0) == pytest.approx(0.0, abs=1e-6)
    radius = 8.0 / 0.4
    # The hinge goes round on its own circle; the axle's line passes through that circle's centre.
    of_hinge = np.hypot(radius, 0.6)
    expected = np.arctan2(0.6, radius) + np.arcsin(6.4 / of_hinge)
    assert swing(trailer, ride(0.4), 50.0) == pytest.approx(-expected, abs=0.02)
    assert swing(trailer, ride(-0.4), 50.0) == pytest.approx(expected, abs=0.02)


def test_nobody_passes_through_a_rig():
    world = build_world("junction", 5, 10.0)
    truck = ride_on(world, rigs()["truck"])
    assert ride_on(world, rigs()["car"]) is world
    assert 0 < len(truck.movers) < len(world.movers)
    assert truck.motion.state.shape[1] == len(truck.movers)
    for k in range(len(truck.movers)):
        apart = np.linalg.norm(truck.motion.state[:, k, :2] - truck.ego.state[: len(truck.motion.state), :2], axis=1)
        assert apart[truck.motion.present[:, k]].min(initial=np.inf) > 1.5


@pytest.mark.parametrize(("rig", "least"), [("boat", 0.12), ("truck", 0.2), ("backpack", 0.01)])
def test_what_rides_along_is_seen_and_unlabeled(rig, least):
    recording, car = on(rig=rig), on()
    scan, truth = recording[5], recording.truth(5)
    own = scan.is_valid & (truth == Label.UNLABELED) & (np.linalg.norm(scan.points, axis=1) < 10.0)
    before = car[5].is_valid & (car.truth(5) == Label.UNLABELED) & (np.linalg.norm(car[5].points, axis=1) < 10.0)
    assert own.sum() / scan.is_valid.sum() > least
    assert own.sum() > before.sum()


def test_a_hull_keeps_its_place_to_the_sensor_while_the_boat_rocks():
    recording = on(rig="boat")
    a, b = (np.linalg.norm(recording[k].points, axis=1) for k in (1, 6))
    hull = (a > 0) & (b > 0) & (recording.truth(1) == 0) & (recording.truth(6) == 0) & (a < 8.0)
    assert np.median(np.abs(a - b)[hull]) < 0.03
    tilts = recording.reference_poses[:, 2, :2]
    assert np.ptp(tilts, axis=0).max() > 0.01


def test_an_operator_walks_at_a_walking_pace_and_moves_arms_and_legs():
    recording = on(rig="backpack")
    steps = np.linalg.norm(np.diff(recording.reference_poses[:, :3, 3], axis=0), axis=1) / 0.1
    assert np.median(steps) == pytest.approx(1.4, abs=0.4)
    walker = rigs()["backpack"].parts[0]
    assert len({placed(walker, ride(0.0, 1.4), t)[0] for t in np.arange(0.0, 2.0, 0.1)}) > 2


def test_merged_clouds_are_each_lidars_own_carried_by_its_mount():
    recording = on(n_lidars=3)
    scan, merged = recording[4], recording.turns
    assert set(scan.sensor) == {0, 1, 2}
    assert scan.T_scan_sensor[0] == pytest.approx(np.eye(4))
    assert scan.T_scan_sensor[1][:3, 3] == pytest.approx([1.7, 0.85, -0.75])
    for k, T in enumerate(scan.T_scan_sensor):
        own, rows = merged._lidars[k][4], scan.sensor == k
        back = transform(inverse(T), scan.points[rows].astype(np.float64))
        assert np.abs(back - own.points[own.is_valid]).max() < 1e-4
        truth, of_one = recording.truth(4)[rows], merged._lidars[k].truth(4)[own.is_valid]
        assert np.array_equal(truth >> 16, of_one >> 16)  # one alone may have seen too little of them
        is_judged = (of_one & 0xFFFF) != Label.UNLABELED
        assert np.array_equal(truth[is_judged], of_one[is_judged])
    assert len(set(scan.ring)) == 3 * 64
    assert scan.is_valid.all()


@pytest.mark.slow
def test_objects_are_judged_by_what_a_lidar_sees_from_its_own_mount():
    truth = record("city", "Avia", 4, 3, conditions=Conditions(mount=3)).truth(0)  # it looks back, the first one ahead
    assert np.mean((truth[truth >> 16 > 0] & 0xFFFF) == Label.UNLABELED) < 0.1


@pytest.mark.parametrize("weather", ["rain", "dust"])
def test_what_flies_in_the_air_is_nearer_than_what_it_hides_and_an_outlier(weather):
    clear, spoilt = on(), on(weather=weather)
    a, b = (np.linalg.norm(q[5].points, axis=1) for q in (clear, spoilt))
    nearer = (b > 0) & (a > 0) & (b < a - 0.5)
    assert nearer.sum() > 200
    in_air = (spoilt.truth(5) & 0xFFFF) == OUTLIER
    assert in_air[nearer].mean() > 0.9
    assert not to_mos(spoilt.truth(5)[in_air]).any()  # not scored
    assert not (clear.truth(5) == OUTLIER).any()


def test_bright_signs_bleed_into_the_beams_beside_them():
    plain, bloomed = on(), on(blooming=True)
    n_changed = 0
    for k in range(len(plain)):
        a, b = (np.linalg.norm(q[k].points, axis=1) for q in (plain, bloomed))
        rows = np.flatnonzero((np.abs(a - b) > 0.5) & (b > 0))
        n_changed += len(rows)
        for row in rows[bloomed.truth(k)[rows] >> 16 > 0]:  # on an object: as far away as that is
            on_it = (plain.truth(k) >> 16 == bloomed.truth(k)[row] >> 16) & (a > 0)
            assert np.abs(a[on_it] - b[row]).min() < 0.5
    assert n_changed > 10


def test_the_plain_conditions_change_no_byte():
    plain, simulated = on(), simulate(*ASKED)
    assert plain[3].points.tobytes() == simulated[3].points.tobytes()


def test_unknown_conditions_are_listed():
    with pytest.raises(InputError, match=r"rig is 'tank'; choose one of: car, boat, truck, backpack"):
        Conditions("tank")
    with pytest.raises(InputError, match=r"weather is 'hail'"):
        Conditions(weather="hail")
    assert set(RIGS) == set(rigs())


def test_a_scan_in_dust_is_the_same_whichever_thread_reads_it():
    sequence = on(weather="dust")
    alone = [sequence[i].points for i in range(len(sequence))]
    asked = np.random.default_rng(0).integers(0, len(sequence), 24).tolist()
    with ThreadPoolExecutor(6) as pool:
        for i, points in zip(asked, pool.map(lambda i: on(weather="dust")[i].points, asked), strict=True):
            np.testing.assert_array_equal(points, alone[i])
