"""How the ego's body rides."""

import numpy as np
import pytest

from automos.simulation.traffic.driving import DT
from automos.simulation.traffic.motion import ride

N = 200
TIME = DT * np.arange(N)


def wheels(speed: np.ndarray, yaw: np.ndarray | float = 0.0) -> np.ndarray:
    """Return (N, 6) states of wheels that roll at `speed` (N,) in the direction `yaw`."""
    state = np.zeros((N, 6))
    state[:, 3] = yaw
    steps = DT * np.column_stack([speed * np.cos(state[:, 3]), speed * np.sin(state[:, 3])])
    state[1:, :2] = np.cumsum(0.5 * (steps[1:] + steps[:-1]), axis=0)
    return state


def test_on_an_even_road_at_constant_speed_the_body_stays_level_and_on_its_wheels():
    speed = np.full(N, 12.0)
    motion = ride(wheels(speed), speed, np.random.default_rng(0), unevenness=0.0)
    assert motion.state[:, 2:] == pytest.approx(0.0, abs=1e-9)
    assert motion.state[:, 0] == pytest.approx(12.0 * TIME, abs=1e-6)  # at the ends too


def test_braking_makes_the_nose_dive():
    speed = np.clip(15.0 - 3.0 * TIME, 0.0, None)
    motion = ride(wheels(speed), speed, np.random.default_rng(0), unevenness=0.0)
    forward = motion.at(2.0)[:3, 0]
    assert forward[2] == pytest.approx(-0.006 * 3.0, rel=0.05)


def test_the_body_leans_out_of_a_bend():
    speed = np.full(N, 10.0)
    motion = ride(wheels(speed, 0.2 * TIME), speed, np.random.default_rng(0), unevenness=0.0)
    left = motion.at(5.0)[:3, 1]  # a left bend lifts the left side
    assert left[2] == pytest.approx(0.007 * 10.0 * 0.2, rel=0.05)


def test_an_uneven_road_shakes_a_moving_car_but_not_a_standing_one():
    for speed, shakes in ((np.full(N, 8.0), True), (np.zeros(N), False)):
        motion = ride(wheels(speed), speed, np.random.default_rng(0))
        assert (motion.state[:, 4].std() > 5e-4) == shakes


def test_poses_between_the_steps_are_smooth():
    speed = 10.0 + 2.0 * np.sin(TIME)
    motion = ride(wheels(speed), speed, np.random.default_rng(0))
    fine = motion.at(np.arange(1.0, 8.0, 0.005))[:, :3, 3]
    acceleration = np.diff(fine[:, 0], 2) / 0.005**2
    assert np.abs(acceleration).max() < 4.0
