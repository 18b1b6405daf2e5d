"""A narrow one-way street of two lanes: lorries beside the ego hide one half of the world for seconds."""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import side_streets, winding
from automos.simulation.shapes import vehicles
from automos.simulation.shapes.materials import Material
from automos.simulation.terrain import Road
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

SPEED = 6.0
LEAD_IN = 120.0


def narrow(rng: np.random.Generator, duration: float) -> World:
    """Return a narrow street with lorries and buses on the lane beside the ego."""
    main = through(winding(rng, SPEED * duration + 2 * LEAD_IN, (80.0, 140.0), (5.0, 20.0)), radius=60.0)
    sides = side_streets(rng, main, (50.0, 90.0), 60.0)
    roads = (Road(main, 4.3, 2.4), *(Road(path, 2.6, 1.2) for path in sides))
    site = Site.over_hills(rng, ((0.5, 200.0),), roads, verge=Material.SOIL)
    _populate(site, main)
    _furnish(site, main, sides)
    return site.finish(duration)


def _populate(site: Site, main: Path) -> None:
    rng = site.rng
    right, left = main.beside(-1.6), main.beside(1.7)
    site.add_ego(right, LEAD_IN, SPEED, wander=0.05)
    lorry = vehicles.make_tractor_and_trailer(rng)
    start, pace = LEAD_IN - rng.uniform(2.0, 8.0), SPEED * rng.uniform(1.08, 1.16)
    road_users.add_agent(site, Agent(lorry, left, start, pace, gaps=(0.0, vehicles.TRAILER_GAP), wander=0.05), 0.3)
    road_users.fill_lane(site, left, SPEED * 1.1, (6.0, 25.0), heavy=0.6)
    road_users.fill_lane(site, right, SPEED, (10.0, 40.0), heavy=0.3)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 5.4), int(main.length / 12.0), 0.3)
        road_users.add_standers(site, main, side * 6.3, int(main.length / 60.0))


def _furnish(site: Site, main: Path, sides: list[Path]) -> None:
    for side in (-1.0, 1.0):
        roadside.place_buildings(site, main, side, 6.9, (3, 6), widths=(8.0, 16.0), gap_chance=0.08)
        roadside.place_lamps(site, main, side, 4.7, spacing=35.0)
        roadside.place_clutter(site, main, side, 6.4, spacing=(10.0, 30.0))
    for street in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, street, side, 4.6, (2, 5), widths=(8.0, 16.0), gap_chance=0.15)
            road_users.park_row(site, street, side * 1.6, 0.3, start=12.0)
