"""Half a minute and longer of a town, for objects: each is seen long enough to wait, hide, part and come back.

Lights and queues, cars that leave and that park, people in pairs and groups, long vehicles, vans that hide the rest.
"""

import numpy as np

from automos.simulation.road_users import Life
from automos.simulation.scenarios.city import street
from automos.simulation.scenarios.junction import cross
from automos.simulation.scenarios.waiting import watch
from automos.simulation.world import World

GROUPS = {4: 0.15, 3: 0.2, 2: 0.35, 1: 0.3}
LIVES = {
    "lights": Life(heavy=0.3, arrive=40.0, leave=45.0, vans=0.15, parties=GROUPS),
    "kerbside": Life(heavy=0.1, arrive=60.0, leave=30.0, vans=0.4, parties=GROUPS),
    "outing": Life(heavy=0.2, arrive=35.0, leave=40.0, vans=0.3, parties={5: 0.15, 3: 0.25, 2: 0.35, 1: 0.25}),
}
WAITS = 39.0
"""Seconds by which the lights are ahead: the ego stands in the queue for about ten, then drives on."""


def lights(rng: np.random.Generator, duration: float) -> World:
    """Return a junction with long vehicles and queues, which the ego waits at and crosses."""
    return cross(rng, duration, 2, WAITS, LIVES["lights"])


def kerbside(rng: np.random.Generator, duration: float) -> World:
    """Return a street where cars leave and park all the time, between vans that hide them and the people behind."""
    return street(rng, duration, LIVES["kerbside"])


def outing(rng: np.random.Generator, duration: float) -> World:
    """Return a junction watched from the kerb, with groups of people on all pavements."""
    return watch(rng, duration, LIVES["outing"])
