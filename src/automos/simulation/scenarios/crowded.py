"""Crowded streets: a narrow one-way street where lorries hide half of the world, a market street full of two-wheelers.

On `narrow`, lorries and buses beside the ego hide one half of the world for seconds. On `scooters`, motorcycles and
scooters ride abreast, between stalls, cars and people.
"""

from functools import partial

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import side_streets, winding
from automos.simulation.shapes import people, vehicles
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import box, join, rod
from automos.simulation.terrain import Road
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

NARROW, MARKET = 6.0, 7.0
"""m/s of the traffic."""
LEAD_IN = 120.0


def narrow(rng: np.random.Generator, duration: float) -> World:
    """Return a narrow street with lorries and buses on the lane beside the ego."""
    main = through(winding(rng, NARROW * duration + 2 * LEAD_IN, (80.0, 140.0), (5.0, 20.0)), radius=60.0)
    sides = side_streets(rng, main, (50.0, 90.0), 60.0)
    roads = (Road(main, 4.3, 2.4), *(Road(path, 2.6, 1.2) for path in sides))
    site = Site.over_hills(rng, ((0.5, 200.0),), roads, verge=Material.SOIL)
    _populate_narrow(site, main)
    _furnish_narrow(site, main, sides)
    return site.finish(duration)


def _populate_narrow(site: Site, main: Path) -> None:
    rng = site.rng
    right, left = main.beside(-1.6), main.beside(1.7)
    site.add_ego(right, LEAD_IN, NARROW, wander=0.05)
    lorry = vehicles.make_tractor_and_trailer(rng)
    start, pace = LEAD_IN - rng.uniform(2.0, 8.0), NARROW * rng.uniform(1.08, 1.16)
    road_users.add_agent(site, Agent(lorry, left, start, pace, gaps=(0.0, vehicles.TRAILER_GAP), wander=0.05), 0.3)
    road_users.fill_lane(site, left, NARROW * 1.1, (6.0, 25.0), heavy=0.6)
    road_users.fill_lane(site, right, NARROW, (10.0, 40.0), heavy=0.3)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 5.4), int(main.length / 12.0), 0.3)
        road_users.add_standers(site, main, side * 6.3, int(main.length / 60.0))


def _furnish_narrow(site: Site, main: Path, sides: list[Path]) -> None:
    for side in (-1.0, 1.0):
        roadside.place_buildings(site, main, side, 6.9, (3, 6), widths=(8.0, 16.0), gap_chance=0.08)
        roadside.place_lamps(site, main, side, 4.7, spacing=35.0)
        roadside.place_clutter(site, main, side, 6.4, spacing=(10.0, 30.0))
    for street in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, street, side, 4.6, (2, 5), widths=(8.0, 16.0), gap_chance=0.15)
            road_users.park_row(site, street, side * 1.6, 0.3, start=12.0)


def scooters(rng: np.random.Generator, duration: float) -> World:
    """Return a busy street of two-wheelers."""
    main = through(winding(rng, MARKET * duration + 2 * LEAD_IN, (90.0, 160.0), (5.0, 30.0)), radius=40.0)
    sides = side_streets(rng, main, (45.0, 80.0), 60.0)
    roads = (Road(main, 5.5, 3.6), *(Road(path, 2.6, 1.0) for path in sides))
    site = Site.over_hills(rng, ((0.3, 200.0),), roads, verge=Material.SOIL, kerb=0.1)
    _populate(site, main)
    _furnish(site, main, sides)
    return site.finish(duration)


def _populate(site: Site, main: Path) -> None:
    rng = site.rng
    for lane, carries_ego in ((main.beside(-2.7), True), (main.reversed().beside(-2.7), False)):
        if carries_ego:
            site.add_ego(lane, LEAD_IN, MARKET, wander=0.1)
        road_users.fill_lane(site, lane, MARKET * 0.95, (35.0, 90.0), heavy=0.08)
        for offset in (-1.7, -0.55, 0.55, 1.7):
            s = rng.uniform(22.0, 30.0)
            while s < lane.length - 15.0:
                rider = people.make_motorcyclist(rng, passenger=bool(rng.random() < 0.3))
                pace = MARKET * rng.uniform(0.75, 1.35)
                path_offset = offset + rng.normal(0.0, 0.15)
                agent = Agent((rider,), lane, s, pace, offset=path_offset, wander=0.25, headway=0.7)
                road_users.add_agent(site, agent, clearance=0.35)
                s += rng.uniform(5.0, 20.0)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 7.8), int(main.length / 9.0), 0.4)
        road_users.add_standers(site, main, side * 8.6, int(main.length / 30.0))
    for s in np.arange(LEAD_IN + 20.0, main.length - LEAD_IN, 45.0):
        at, heading = main.at(s + rng.uniform(0.0, 20.0))
        left = np.array([-np.sin(heading), np.cos(heading)])
        across = through([at + 7.5 * left, at - 7.5 * left])
        road_users.add_agent(
            site, Agent((road_users.a_walker(rng),), across, 1.0, rng.uniform(0.9, 1.4), go=rng.uniform(0.0, 10.0)), 0.2
        )


def _furnish(site: Site, main: Path, sides: list[Path]) -> None:
    rng = site.rng
    for side in (-1.0, 1.0):
        for x, y, heading in roadside.along(site, main, side * 6.4, (0.9, 6.0), 0.25):
            if site.is_free(x, y, 0.6):
                site.park(people.make_parked_scooter(rng), x, y, heading + side * rng.uniform(1.0, 1.6))
        roadside.place_row(site, main, side, 9.3, (4.0, 14.0), 1.2, partial(_stall, rng))
        roadside.place_buildings(site, main, side, 10.6, (2, 5), widths=(4.0, 9.0), gap_chance=0.1)
        roadside.place_trees(site, main, side * 8.5, (18.0, 45.0))
        roadside.place_lamps(site, main, side, 5.8)
    for street in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, street, side, 4.6, (2, 4), widths=(4.0, 9.0), gap_chance=0.15)


def _stall(rng: np.random.Generator):  # type: ignore[no-untyped-def]
    """Return a market stall: a table of goods under an awning."""
    width = rng.uniform(1.6, 3.0)
    posts = [
        rod((x, y, 0), (x, y, 2.2), 0.03, Material.METAL, sections=5)
        for x in (-width / 2, width / 2)
        for y in (-0.6, 0.6)
    ]
    goods = [
        box(rng.uniform(0.2, 0.5, 3), (x, rng.uniform(-0.4, 0.3), 1.0), Material.CLOTH, rng.uniform(0.3, 2.0))
        for x in np.arange(-width / 2, width / 2, 0.4)
    ]
    awning = box((width + 0.4, 1.7, 0.05), (0, -0.1, 2.2), Material.CLOTH, rng.uniform(0.5, 1.8))
    return join([*posts, *goods, awning, box((width, 1.0, 0.8), (0, 0, 0.45), Material.BARK)])
