"""A sensor that stands still at a junction: everything is seen from one place only."""

from __future__ import annotations

import numpy as np

from automos.simulation.scenarios.junction import furnish, make_crossing, make_site, populate
from automos.simulation.shapes import vehicles
from automos.simulation.traffic.agents import Agent
from automos.simulation.world import Site, World


def waiting(rng: np.random.Generator, duration: float) -> World:
    """Return a junction watched from a vehicle that stands at the kerb of one arm and never moves."""
    crossing = make_crossing(rng, shift=float(rng.uniform(0.0, 40.0)))
    site: Site = make_site(rng, crossing)
    kerb = crossing.arm(0).reversed().beside(-4.6)
    ego = vehicles.make_car(rng, "estate")
    site.agents.append(Agent((ego,), kerb, crossing.reaches[0] - 22.0, 1.0, initial=0.0, go=np.inf, wander=0.0))
    populate(site, crossing, duration)
    furnish(site, crossing)
    return site.finish(duration)
