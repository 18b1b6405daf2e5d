"""The ground, a crate and a sensor without noise: what tests of the simulator build their small worlds from."""

import numpy as np
import pytest

from automos.simulation.sensing.sensors import Sensor
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box
from automos.simulation.shapes.things import Thing


@pytest.fixture
def ground() -> Mesh:
    """Return a square kilometre at z = 0."""
    return box((1000.0, 1000.0, 1.0), (0.0, 0.0, -0.5), Material.ASPHALT)


@pytest.fixture
def crate() -> Thing:
    """Return a cube of 2 m that stands on the ground."""
    return Thing("car", (box((2.0, 2.0, 2.0), (0.0, 0.0, 1.0), Material.WALL),), axles=(-0.7, 0.7))


@pytest.fixture
def clean_sensor() -> Sensor:
    """Return a spinning sensor without noise, 360 columns of 3 beams, 10 Hz, counter-clockwise from the back."""
    return Sensor(
        "clean",
        elevations=np.array([0.0, -2.0, -10.0]),
        columns=360,
        period=0.1,
        reach=1e6,
        max_range=100.0,
        min_range=0.1,
        noise=0.0,
        ring_bias=0.0,
        divergence=0.0,
        height=1.0,
        turn=1,
    )
