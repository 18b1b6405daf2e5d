"""Beams against bodies whose distances are known."""

import numpy as np
import pytest
from small_worlds import make_world, straight

from automos.simulation.sensing.cast import Caster
from automos.simulation.sensing.scene import EGO, Hits, Scene
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import box, join

LEVEL = 0  # the beam at elevation 0 in `clean_sensor`
T_BODY_SENSOR = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1.0], [0, 0, 0, 1]])


def sweep(world, sensor, start=0.0):
    pattern = sensor.pattern(0)
    times = start + (np.arange(sensor.columns) + 0.5) / sensor.columns * sensor.period
    T = world.ego.at(times) @ T_BODY_SENSOR
    chance = np.full(len(pattern.direction), 0.5, np.float32)
    hits = Caster(world).sweep(pattern, T, T_BODY_SENSOR, (start, start + sensor.period), sensor.max_range, chance)
    return pattern, hits


def at_azimuth(pattern, degrees, ring=LEVEL):
    """Return the row of the beam of `ring` that points nearest to an azimuth."""
    azimuth = np.degrees(np.arctan2(pattern.direction[:, 1], pattern.direction[:, 0]))
    apart = np.abs((azimuth - degrees + 180.0) % 360.0 - 180.0)
    return int(np.argmin(np.where(pattern.ring == ring, apart, np.inf)))


def test_the_nearest_surface_is_hit_at_its_distance(ground, crate, clean_sensor):
    wall = box((1.0, 20.0, 6.0), (20.5, 0.0, 3.0), Material.WALL)
    parked = ((crate, np.array([10.0, 0.0, 0.0, 0.0, 0.0, 0.0])),)
    pattern, hits = sweep(make_world(join([ground, wall]), [], parked=parked), clean_sensor)
    ahead, beside = at_azimuth(pattern, 0.0), at_azimuth(pattern, 20.0)
    azimuth = np.arctan2(pattern.direction[beside, 1], pattern.direction[beside, 0])
    assert hits.distance[ahead] == pytest.approx(9.0, abs=0.01)  # the crate's rear face
    assert hits.object[ahead] == 1
    assert hits.distance[beside] == pytest.approx(20.0 / np.cos(azimuth), abs=0.01)  # the wall behind it
    assert hits.object[beside] == 0


def test_the_ground_is_hit_where_a_beam_meets_the_plane(ground, clean_sensor):
    pattern, hits = sweep(make_world(ground, []), clean_sensor)
    row = at_azimuth(pattern, 90.0, ring=1)
    assert hits.distance[row] == pytest.approx(1.0 / np.sin(np.radians(2.0)), rel=1e-3)
    assert hits.cosine[row] == pytest.approx(np.sin(np.radians(2.0)), rel=1e-3)


def test_a_mover_is_seen_where_it_is_at_the_beams_own_time(ground, crate, clean_sensor):
    # 30 m/s toward the sensor from x = 21 at t = 0: its front face is at 20 - 30 t, seen at mid-sweep, t = 0.05.
    mover = straight([21.0, 0.0, 0.0], [-30.0, 0.0, 0.0])
    pattern, hits = sweep(make_world(ground, [(crate, mover)]), clean_sensor)
    row = at_azimuth(pattern, 0.5)
    time = (pattern.phase[row] + 0.5) * clean_sensor.period
    assert hits.distance[row] == pytest.approx(20.0 - 30.0 * time, abs=0.02)
    assert hits.object[row] == 1


def test_a_turning_body_is_seen_at_the_angle_of_the_beams_time(ground, crate, clean_sensor):
    # The face of a 2 m cube at x = 10, turned by 0.25 rad at mid-sweep: x cos 0.25 + y sin 0.25 = 10 cos 0.25 - 1.
    state = straight([10.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    state[:, 3] = 0.25 + 1.0 * (0.05 * np.arange(len(state)) - 0.05)
    pattern, hits = sweep(make_world(ground, [(crate, state)]), clean_sensor)
    row = at_azimuth(pattern, 0.5)
    azimuth = np.arctan2(pattern.direction[row, 1], pattern.direction[row, 0])
    assert hits.distance[row] == pytest.approx((10.0 * np.cos(0.25) - 1.0) / np.cos(0.25 - azimuth), abs=0.005)


def test_the_sensors_own_motion_shows_in_the_distances(ground, clean_sensor):
    wall = box((1.0, 400.0, 6.0), (50.5, 0.0, 3.0), Material.WALL)
    world = make_world(join([ground, wall]), [], ego=straight([0.0, 0.0, 0.0], [20.0, 0.0, 0.0]))
    pattern, hits = sweep(world, clean_sensor, start=1.0)
    for degrees in (-40.0, 0.0, 40.0):
        row = at_azimuth(pattern, degrees)
        azimuth = np.arctan2(pattern.direction[row, 1], pattern.direction[row, 0])
        x = 20.0 * (1.0 + (pattern.phase[row] + 0.5) * 0.1)
        assert hits.distance[row] == pytest.approx((50.0 - x) / np.cos(azimuth), abs=0.02)


def test_sorting_beams_by_sector_loses_no_hit(ground, crate, clean_sensor):
    rng = np.random.default_rng(0)
    places = rng.uniform(-30.0, 30.0, (25, 2))
    places = places[np.hypot(*places.T) > 3.0]
    movers = [(crate, straight([x, y, 0.0], [*rng.uniform(-20.0, 20.0, 2), 0.0])) for x, y in places]
    world = make_world(ground, movers, ego=straight([0.0, 0.0, 0.0], [15.0, 0.0, 0.0]))
    pattern, hits = sweep(world, clean_sensor)
    # The same world cast slowly: every body tried on every beam, one small time slice after another.
    slow = Hits.none(len(pattern.direction), clean_sensor.max_range)
    for c in range(clean_sensor.columns):
        rows = np.flatnonzero(pattern.column == c)
        time = (c + 0.5) / clean_sensor.columns * clean_sensor.period
        state, _, _ = world.motion.at(time)
        boxes = [crate.frames[0].moved(*s[:3], yaw=s[3]) for s in state]
        origin = np.tile((world.ego.at(time) @ T_BODY_SENSOR)[:3, 3].astype(np.float32), (len(rows), 1))
        Scene(join([ground, *boxes]), 0).cast(
            origin, pattern.direction[rows], slow, rows, np.full(len(rows), 0.5, np.float32)
        )
    own = hits.object == EGO
    assert np.abs(hits.distance - slow.distance)[~own].max() < 0.05
    assert (hits.object > 0).sum() > 50


def test_panes_return_swallow_and_pass_beams(ground, clean_sensor):
    panes = [box((0.01, 4.0, 4.0), (10.0, y, 2.0), Material.WINDOW) for y in np.arange(-300.0, 300.0, 4.0)]
    wall = box((1.0, 800.0, 6.0), (15.5, 0.0, 3.0), Material.WALL)
    world = make_world(join([ground, *panes, wall]), [])
    pattern, hits = sweep(world, clean_sensor)
    azimuth = np.arctan2(pattern.direction[:, 1], pattern.direction[:, 0])
    ahead = (pattern.ring == LEVEL) & (np.abs(azimuth) < 1.4)
    depth = (hits.distance * np.cos(azimuth))[ahead]
    on_wall = np.abs(depth - 15.0) < 0.05
    assert np.all(on_wall | (np.abs(depth - 10.0) < 0.05))
    assert 0 < on_wall.sum() < len(depth)
    assert np.all(hits.tint[ahead][on_wall] < 1.0)  # dimmed by the pane
