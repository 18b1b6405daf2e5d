"""Moving means: moved at some time while observed."""

import numpy as np
from small_worlds import N_STEPS, make_world, straight

from automos.simulation.sensing.cast import Caster
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import box, join
from automos.simulation.truth import judge

STAMPS = np.arange(0.05, 2.9, 0.1)
T_SITE_SENSOR = np.tile(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1.7], [0, 0, 0, 1.0]]), (len(STAMPS), 1, 1))


def verdict_of(world, sensor, k=0):
    verdicts = judge(world, Caster(world).still, sensor, T_SITE_SENSOR, STAMPS)
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
    state[:30, 0] = np.linspace(220.0, 95.0, 30)
    state[30:, 0] = 95.0
    state[:30, 0] = np.maximum(state[:30, 0], 101.5)
    assert verdict_of(make_world(ground, [(crate, state)]), clean_sensor) == "static"


def test_a_move_too_small_to_tell_is_unknown(ground, crate, clean_sensor):
    world = make_world(ground, [(crate, straight([15.0, 0.0, 0.0], [0.0, 0.1, 0.0]))])
    assert verdict_of(world, clean_sensor) == "unknown"
