"""Crowded places: a narrow one-way street, a market street full of two-wheelers, a campus full of people.

On `narrow`, lorries and buses beside the ego hide one half of the world for seconds. On `scooters`, motorcycles and
scooters ride abreast, between stalls, cars and people. On the `campus`, the ego creeps through crowds on foot among
trees; slow motion is the hard part.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.streets import side_streets, winding
from automos.simulation.shapes import furniture, people, vehicles
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box, of_parts, rod
from automos.simulation.terrain import Road
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path, every, through
from automos.simulation.world import Site, World

NARROW, MARKET, CAMPUS = 6.0, 7.0, 2.5
"""m/s of the traffic, or of the ego."""
LEAD_IN, CAMPUS_LEAD_IN = 120.0, 80.0
"""Metres of way behind the ego's start and beyond its end."""


def narrow(rng: np.random.Generator, duration: float) -> World:
    """Return a narrow street with lorries and buses on the lane beside the ego."""
    main = winding(rng, NARROW * duration + 2 * LEAD_IN, (80.0, 140.0), (5.0, 20.0), radius=60.0)
    sides = side_streets(rng, main, (50.0, 90.0), 60.0)
    roads = (Road(main, 4.3, 2.4), *(Road(path, 2.6, 1.2) for path in sides))
    site = Site(rng, ((0.5, 200.0),), roads, verge=Material.SOIL)
    right, left = main.beside(-1.6), main.beside(1.7)
    site.add_ego(right, LEAD_IN, NARROW, wander=0.05)
    lorry = vehicles.make_tractor_and_trailer(rng)
    start, pace = LEAD_IN - rng.uniform(2.0, 8.0), NARROW * rng.uniform(1.08, 1.16)
    site.add_agent(Agent(lorry, left, start, pace, wander=0.05), clearance=0.3)
    road_users.fill_lane(site, left, NARROW * 1.1, (6.0, 25.0), heavy=0.6)
    road_users.fill_lane(site, right, NARROW, (10.0, 40.0), heavy=0.3)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 5.4), int(main.length / 12.0), 0.3)
        road_users.add_standers(site, main, side * 6.3, int(main.length / 60.0))
    for side in (-1.0, 1.0):
        roadside.place_buildings(site, main, side, 6.9, (3, 6), widths=(8.0, 16.0), gap_chance=0.08)
        roadside.place_lamps(site, main, side, 4.7, spacing=35.0)
        roadside.place_clutter(site, main, side, 6.4, spacing=(10.0, 30.0))
    for street in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, street, side, 4.6, (2, 5), widths=(8.0, 16.0), gap_chance=0.15)
            road_users.park_row(site, street, side * 1.6, 0.3, start=12.0)
    return site.finish(duration)


def scooters(rng: np.random.Generator, duration: float) -> World:
    """Return a busy street of two-wheelers."""
    main = winding(rng, MARKET * duration + 2 * LEAD_IN, (90.0, 160.0), (5.0, 30.0), radius=40.0)
    sides = side_streets(rng, main, (45.0, 80.0), 60.0)
    roads = (Road(main, 5.5, 3.6), *(Road(path, 2.6, 1.0) for path in sides))
    site = Site(rng, ((0.3, 200.0),), roads, verge=Material.SOIL, kerb=0.1)
    with_ego, oncoming = main.beside(-2.7), main.reversed().beside(-2.7)
    site.add_ego(with_ego, LEAD_IN, MARKET, wander=0.1)
    for lane in (with_ego, oncoming):
        road_users.fill_lane(site, lane, MARKET * 0.95, (35.0, 90.0), heavy=0.08)
        for offset in (-1.7, -0.55, 0.55, 1.7):
            for s in every(rng, (5.0, 20.0), rng.uniform(22.0, 30.0), lane.length - 15.0):
                rider = people.make_motorcyclist(rng, passenger=bool(rng.random() < 0.3))
                pace = MARKET * rng.uniform(0.75, 1.35)
                aside = offset + rng.normal(0.0, 0.15)
                agent = Agent((rider,), lane, s, pace, offset=aside, wander=0.25, headway=0.7)
                site.add_agent(agent, clearance=0.35)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 7.8), int(main.length / 9.0), 0.4)
        road_users.add_standers(site, main, side * 8.6, int(main.length / 30.0))
    for s in np.arange(LEAD_IN + 20.0, main.length - LEAD_IN, 45.0):
        at, turn = main.at(s + rng.uniform(0.0, 20.0))
        left = np.array([-np.sin(turn), np.cos(turn)])
        across = through([at + 7.5 * left, at - 7.5 * left])
        walker, pace = road_users.a_walker(rng), rng.uniform(0.9, 1.4)
        site.add_agent(Agent((walker,), across, 1.0, pace, go=rng.uniform(0.0, 10.0)), clearance=0.2)
    for side in (-1.0, 1.0):
        for place, heading in roadside.along(site, main, side * 6.4, (0.9, 6.0), 0.25):
            if site.is_free(place, 0.6):
                site.park(people.make_parked_scooter(rng), place, heading + side * rng.uniform(1.0, 1.6))
        roadside.place_row(site, main, side, 9.3, (4.0, 14.0), 1.2, partial(_stall, rng))
        roadside.place_buildings(site, main, side, 10.6, (2, 5), widths=(4.0, 9.0), gap_chance=0.1)
        roadside.place_trees(site, main, side * 8.5, (18.0, 45.0))
        roadside.place_lamps(site, main, side, 5.8)
    for street in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, street, side, 4.6, (2, 4), widths=(4.0, 9.0), gap_chance=0.15)
    return site.finish(duration)


@of_parts
def _stall(rng: np.random.Generator) -> Iterator[Mesh]:
    """Return a market stall: a table of goods under an awning."""
    width = rng.uniform(1.6, 3.0)
    for x in (-width / 2, width / 2):
        for y in (-0.6, 0.6):
            yield rod((x, y, 0), (x, y, 2.2), 0.03, Material.METAL, sections=5)
    for x in np.arange(-width / 2, width / 2, 0.4):
        size, place = rng.uniform(0.2, 0.5, 3), (x, rng.uniform(-0.4, 0.3), 1.0)
        yield box(size, place, Material.CLOTH, rng.uniform(0.3, 2.0))
    yield box((width + 0.4, 1.7, 0.05), (0, -0.1, 2.2), Material.CLOTH, rng.uniform(0.5, 1.8))
    yield box((width, 1.0, 0.8), (0, 0, 0.45), Material.BARK)


def campus(rng: np.random.Generator, duration: float) -> World:
    """Return a walkway with crossing paths, lawns, trees, benches and buildings at some distance."""
    main = winding(rng, CAMPUS * duration + 2 * CAMPUS_LEAD_IN, (50.0, 90.0), (10.0, 40.0), radius=25.0)
    crossings = _crossing_walks(rng, main)
    roads = (Road(main, 3.2), *(Road(path, 1.6) for path in crossings))
    site = Site(rng, ((0.6, 150.0),), roads, kerb=0.03, roughness=0.04)
    site.add_ego(main, CAMPUS_LEAD_IN, CAMPUS, wander=0.1, headway=1.0)
    road_users.add_walkers(site, main.beside(2.4), int(main.length / 7.0), 0.9, speed=(0.6, 1.6))
    road_users.add_walkers(site, main.beside(-2.4), int(main.length / 9.0), 0.9, speed=(0.6, 1.6))
    for path in crossings:
        road_users.add_walkers(site, path, 9, 1.2, speed=(0.6, 1.7))
        road_users.add_standers(site, path, rng.uniform(-3.0, 3.0), 3)
    for line in (main, main.reversed()):
        road_users.add_cyclists(site, line.beside(-1.7), max(2, int(main.length / 60.0)), speed=(2.5, 5.0))
    for side in (-1.0, 1.0):
        roadside.place_trees(site, main, side * 4.6, (6.0, 13.0), clearance=0.8)
        roadside.place_trees(site, main, side * 11.0, (7.0, 16.0), clearance=1.0)
        roadside.place_trees(site, main, side * 20.0, (8.0, 20.0), clearance=1.0)
        roadside.scatter_bushes(site, main, (side * 4.5, side * 16.0), (2.5, 6.0))
        roadside.scatter_tufts(site, main, (side * 4.0, side * 16.0), 0.6)
        roadside.place_hedges(site, main, side * 6.0, 0.4)
        roadside.place_thickets(site, main, (side * 12.0, side * 26.0), (6.0, 15.0), (1.5, 3.5))
        roadside.place_buildings(site, main, side, 19.0, (2, 5), widths=(18.0, 45.0), gap_chance=0.7, gaps=(6.0, 18.0))
        roadside.place_row(site, main, side, 3.9, (9.0, 22.0), 0.3, furniture.make_bench)
        for place, heading in roadside.along(site, main, side * 6.5, (14.0, 30.0), 1.5):
            for k in range(int(rng.integers(3, 8))):
                stand = place + 0.75 * k * np.array([np.cos(heading), np.sin(heading)])
                if site.is_free(stand, 0.4):
                    site.park(people.make_parked_bicycle(rng), stand, heading + 0.5 * np.pi + rng.normal(0, 0.1))
        roadside.place_lamps(site, main, side, 3.8, spacing=24.0)
    return site.finish(duration, reach=110.0)


def _crossing_walks(rng: np.random.Generator, main: Path) -> list[Path]:
    walks = []
    for s in every(rng, (22.0, 40.0), rng.uniform(10.0, 25.0), main.length - 10.0):
        at, heading = main.at(s)
        across = heading + 0.5 * np.pi + np.radians(rng.uniform(-35.0, 35.0))
        along = np.array([np.cos(across), np.sin(across)])
        bend = rng.uniform(-12.0, 12.0) * np.array([-along[1], along[0]])
        walks.append(through([at - 45.0 * along + bend, at, at + 45.0 * along - bend], radius=20.0))
    return walks
