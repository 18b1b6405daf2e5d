"""A sensor that stands still at a junction: everything is seen from one place only."""

import numpy as np

from automos.simulation.road_users import Life
from automos.simulation.scenarios.junction import LIFE, furnish, make_crossing, make_site, populate
from automos.simulation.shapes import vehicles
from automos.simulation.traffic.agents import Agent
from automos.simulation.world import Site, World


def waiting(rng: np.random.Generator, duration: float) -> World:
    """Return a junction watched from a vehicle that stands at the kerb of one arm and never moves."""
    return watch(rng, duration, LIFE)


def watch(rng: np.random.Generator, duration: float, life: Life) -> World:
    """Return a junction with a life of its own, watched from the kerb."""
    crossing = make_crossing(rng, shift=float(rng.uniform(0.0, 40.0)))
    site: Site = make_site(rng, crossing)
    kerb = crossing.arm(0).reversed().beside(-4.6)
    ego = vehicles.make_car(rng, "estate")
    site.agents.append(Agent((ego,), kerb, crossing.reaches[0] - 22.0, 1.0, initial=0.0, go=np.inf, wander=0.0))
    populate(site, crossing, duration, life)
    furnish(site, crossing, life)
    return site.finish(duration)
