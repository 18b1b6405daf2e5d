"""A campus: crowds on foot among trees, the ego creeping through them; slow motion is the hard part."""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import winding
from automos.simulation.shapes import furniture, people
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

EGO_SPEED = 2.5
LEAD_IN = 80.0


def campus(rng: np.random.Generator, duration: float) -> World:
    """Return a walkway with crossing paths, lawns, trees, benches and buildings at some distance."""
    length = EGO_SPEED * duration + 2 * LEAD_IN
    main = through(winding(rng, length, (50.0, 90.0), (10.0, 40.0)), radius=25.0)
    crossings = _crossing_walks(rng, main)
    roads = (Road(main, 3.2), *(Road(path, 1.6) for path in crossings))
    site = Site.over_hills(rng, ((0.6, 150.0),), roads, kerb=0.03, roughness=0.04)
    site.add_ego(main, LEAD_IN, EGO_SPEED, wander=0.1, headway=1.0)
    _populate(site, main, crossings)
    _furnish(site, main)
    return site.finish(duration, reach=110.0)


def _crossing_walks(rng: np.random.Generator, main: Path) -> list[Path]:
    walks, s = [], rng.uniform(10.0, 25.0)
    while s < main.length - 10.0:
        at, heading = main.at(s)
        across = heading + 0.5 * np.pi + np.radians(rng.uniform(-35.0, 35.0))
        along = np.array([np.cos(across), np.sin(across)])
        bend = rng.uniform(-12.0, 12.0) * np.array([-along[1], along[0]])
        walks.append(through([at - 45.0 * along + bend, at, at + 45.0 * along - bend], radius=20.0))
        s += rng.uniform(22.0, 40.0)
    return walks


def _populate(site: Site, main: Path, crossings: list[Path]) -> None:
    road_users.add_walkers(site, main.beside(2.4), int(main.length / 7.0), 0.9, speed=(0.6, 1.6))
    road_users.add_walkers(site, main.beside(-2.4), int(main.length / 9.0), 0.9, speed=(0.6, 1.6))
    for path in crossings:
        road_users.add_walkers(site, path, 9, 1.2, speed=(0.6, 1.7))
        road_users.add_standers(site, path, site.rng.uniform(-3.0, 3.0), 3)
    for side in (-1.0, 1.0):
        line = main.beside(side * 1.7) if side < 0 else main.reversed().beside(-1.7)
        road_users.add_cyclists(site, line, max(2, int(main.length / 60.0)), speed=(2.5, 5.0))


def _furnish(site: Site, main: Path) -> None:
    rng = site.rng
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
        for x, y, heading in roadside.along(site, main, side * 6.5, (14.0, 30.0), 1.5):
            for k in range(int(rng.integers(3, 8))):
                place = x + 0.75 * k * np.cos(heading), y + 0.75 * k * np.sin(heading)
                if site.is_free(*place, 0.4):
                    site.park(people.make_parked_bicycle(rng), *place, heading + 0.5 * np.pi + rng.normal(0, 0.1))
        roadside.place_lamps(site, main, side, 3.8, spacing=24.0)
