"""Road users on straight roads, where what they must do is plain."""

import numpy as np
import pytest

from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import box
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.agents import Agent, Signal
from automos.simulation.traffic.driving import DT, MAX_LATERAL, drive
from automos.simulation.traffic.paths import through

ROAD = through([(0.0, 0.0), (600.0, 0.0)])
CAR = Thing("car", (box((4.0, 1.8, 1.5), (0.0, 0.0, 0.75), Material.PAINT),), axles=(-1.3, 1.3))
PERSON = Thing("person", (box((0.4, 0.6, 1.8), (0.0, 0.0, 0.9), Material.CLOTH),))


def car(start, speed, path=ROAD, **more):
    return Agent((CAR,), path, start, speed, wander=0.0, **more)


def walker(start, speed, path, **more):
    return Agent((PERSON,), path, start, speed, wander=0.0, on_foot=True, **more)


def test_alone_on_a_straight_road_one_drives_at_the_speed_one_likes():
    record = drive([car(20.0, 10.0)], [], 20.0)
    assert record.s[-1, 0] == pytest.approx(20.0 + 10.0 * DT * (len(record.s) - 1), rel=0.01)


def test_a_faster_car_falls_in_behind_a_slower_one():
    record = drive([car(120.0, 8.0), car(20.0, 20.0)], [], 40.0)
    gap = record.s[:, 0] - record.s[:, 1] - 4.0
    assert gap.min() > 1.0
    assert record.v[-1, 1] == pytest.approx(8.0, abs=0.3)
    assert gap[-1] == pytest.approx(1.5 + 1.3 * 8.0, rel=0.35)  # standstill gap + headway


def test_cars_stop_at_red_and_go_at_green():
    light = Signal(ROAD, 100.0, period=40.0, green=20.0, shift=20.0)  # red for 20 s, then green
    record = drive([car(20.0, 12.0)], [light], 40.0)
    red, end = int(19.0 / DT), len(record.s) - 1
    assert record.v[red, 0] == 0.0
    assert 95.0 < record.s[red, 0] + 2.0 <= 100.0
    assert record.s[end, 0] > 200.0


def test_a_bend_is_taken_slowly_enough_and_braked_for_in_time():
    path = through([(0.0, 0.0), (150.0, 0.0), (150.0, 150.0)], radius=12.0)
    record = drive([car(20.0, 15.0, path)], [], 30.0)
    curvature = np.interp(record.s[:, 0] / 0.5, np.arange(len(path.xy)), np.abs(path.curvature))
    assert (record.v[:, 0] ** 2 * curvature).max() < 1.5 * MAX_LATERAL
    assert np.diff(record.v[:, 0]).min() / DT > -4.0
    assert record.v[:, 0].max() > 14.0


def test_a_car_that_parks_stops_at_its_place():
    record = drive([car(20.0, 9.0, stop=120.0)], [], 30.0)
    assert record.v[-1, 0] == 0.0
    assert record.s[-1, 0] == pytest.approx(120.0, abs=0.6)


def test_a_car_at_the_kerb_waits_until_the_lane_is_free():
    kerb = ROAD.beside(-2.9).shifted(102.0, 14.0, 2.9)
    waiting = car(100.0, 9.0, kerb, initial=0.0, go=3.0)
    passing = [car(s, 9.0) for s in (75.0, 60.0, 45.0)]
    record = drive([waiting, *passing], [], 30.0)
    started = int(np.argmax(record.v[:, 0] > 0.0))
    last_passed = int(np.argmax(record.s[:, 3] > 108.0))
    assert 0 < last_passed <= started
    assert record.v[-1, 0] > 8.0


def test_a_driver_stops_for_somebody_on_the_road():
    across = through([(100.0, -6.0), (100.0, 6.0)])
    record = drive([car(20.0, 12.0), walker(1.0, 0.8, across)], [], 12.0)
    on_lane = np.abs(record.s[:, 1] - 6.0) < 1.2
    assert on_lane.any()
    assert (record.s[on_lane, 0] + 2.0).max() < 100.0


def test_two_walkers_who_meet_step_aside():
    there = through([(0.0, 0.0), (40.0, 0.0)])
    record = drive([walker(5.0, 1.3, there), walker(5.0, 1.3, there.reversed())], [], 20.0)
    x, y = record.s[:, 0], record.side[:, 0]
    other_x, other_y = 40.0 - record.s[:, 1], -record.side[:, 1]
    assert np.hypot(x - other_x, y - other_y).min() > 0.55
    assert record.s[-1].min() > 20.0


def test_who_enters_later_waits_for_room():
    blocker = car(24.0, 5.0, initial=0.0, go=8.0)
    record = drive([blocker, car(22.0, 10.0, enter=1.0)], [], 20.0)
    entered = int(np.argmax(record.present[:, 1]))
    assert entered * DT > 8.0
    assert record.present[-1, 1]


def test_who_reaches_the_end_of_the_path_is_gone():
    record = drive([car(560.0, 15.0)], [], 10.0)
    assert record.present[0, 0]
    assert not record.present[-1, 0]
