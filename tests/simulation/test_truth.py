"""Moving means: moved at some time while observed."""

import numpy as np
from small_worlds import N_STEPS, make_world, straight

from automos.simulation.sensing.cast import Caster
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import box, join
from automos.simulation.shapes.things import Thing
from automos.simulation.truth import judge

STAMPS = np.arange(0.05, 2.9, 0.1)
T_SITE_SENSOR = np.tile(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1.7], [0, 0, 0, 1.0]]), (len(STAMPS), 1, 1))


def seen_in(world, sensor):
    """Return (S, K) whether a beam of each sweep ends on each object."""
    caster, pattern, seen = Caster(world), sensor.pattern(0), []
    chance = np.full(len(pattern.direction), 0.5, np.float32)
    for T, time in zip(T_SITE_SENSOR, STAMPS, strict=True):
        poses = np.tile(T, (sensor.columns, 1, 1))
        hits = caster.sweep(pattern, poses, np.eye(4), (time - 0.05, time + 0.05), sensor.max_range, chance)
        seen.append(np.isin(np.arange(len(world.objects)) + 1, hits.object))
    return np.array(seen)


def verdict_of(world, sensor, k=0):
    verdicts = judge(world, seen_in(world, sensor), STAMPS, sensor.period)
    return "moving" if verdicts.is_moving[k] else "static" if verdicts.is_static[k] else "unknown"


def test_a_car_that_drives_is_moving_and_one_that_stands_is_static(ground, crate, clean_sensor):
    for velocity, expected in ((5.0, "moving"), (0.0, "static")):
        world = make_world(ground, [(crate, straight([15.0, 0.0, 0.0], [0.0, velocity, 0.0]))])
        assert verdict_of(world, clean_sensor) == expected


def test_a_parked_object_is_static(ground, crate, clean_sensor):
    world = make_world(ground, [], parked=((crate, np.array([10.0, 0, 0, 0, 0, 0])),))
    assert verdict_of(world, clean_sensor) == "static"


def test_a_car_that_waits_and_then_drives_is_moving(ground, crate, clean_sensor):
    state = straight([15.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    state[40:, 1] = 5.0 * 0.05 * np.arange(N_STEPS - 40)
    assert verdict_of(make_world(ground, [(crate, state)]), clean_sensor) == "moving"


def test_a_car_that_moves_only_where_it_cannot_be_seen_is_static(ground, crate, clean_sensor):
    # Behind the wall for 0.8 s, on the move; from then on at rest in the open.
    wall = box((1.0, 20.0, 4.0), (10.0, -12.0, 2.0), Material.WALL)
    state = straight([20.0, 2.0, 0.0], [0.0, 0.0, 0.0])
    state[:16, 1] = np.linspace(-25.0, -18.0, 16)
    assert verdict_of(make_world(join([ground, wall]), [(crate, state)]), clean_sensor) == "static"
    assert verdict_of(make_world(ground, [(crate, state)]), clean_sensor) == "moving"


def test_a_car_that_moves_only_out_of_range_is_static(ground, crate, clean_sensor):
    state = straight([150.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    state[:, 0] = 100.98 + 120.0 * np.maximum(1.0 - np.arange(N_STEPS) / 30.0, 0.0) ** 4  # its front comes to 99.98 m
    assert seen_in(make_world(ground, [(crate, state)]), clean_sensor)[-1].all()
    assert verdict_of(make_world(ground, [(crate, state)]), clean_sensor) == "static"


def test_a_car_that_drives_off_only_behind_another_that_passes_is_static(ground, crate, clean_sensor):
    # It stands in the open for half a second; then a lorry stops before it, and it leaves unseen.
    state = straight([20.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    state[20:, 0] = 20.0 + 0.3 * np.arange(N_STEPS - 20)
    lorry = Thing("truck", (box((2.0, 12.0, 6.0), (0.0, 0.0, 3.0), Material.WALL),), axles=(-0.7, 0.7))
    before = straight([10.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    before[:20, 1] = np.linspace(40.0, 0.0, 20)
    assert verdict_of(make_world(ground, [(crate, state), (lorry, before)]), clean_sensor) == "static"
    assert verdict_of(make_world(ground, [(crate, state)]), clean_sensor) == "moving"


def test_a_car_that_drives_only_between_the_beams_is_not_judged(ground, crate, clean_sensor):
    world = make_world(ground, [(crate, straight([15.0, 0.0, 5.0], [0.0, 5.0, 0.0]))])  # above all of them
    assert verdict_of(world, clean_sensor) == "unknown"


def test_a_move_too_small_to_tell_is_unknown(ground, crate, clean_sensor):
    world = make_world(ground, [(crate, straight([15.0, 0.0, 0.0], [0.0, 0.1, 0.0]))])
    assert verdict_of(world, clean_sensor) == "unknown"
