"""Motorways: nearly everything moves, and fast; little stands still to hold on to.

On `motorway` all are in full flight from the first scan, between bare verges; on `slowdown` all pick up speed after a
slow section, between shrubs.
"""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import winding
from automos.simulation.shapes import furniture, vehicles
from automos.simulation.terrain import Road
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

EGO_SPEED = 28.0
LANES = (24.0, 29.0, 34.0)
"""m/s on the right, middle and left lane."""
SLOW = 0.6
"""Share of their speed at which all leave a slow section."""
LANE_WIDTH = 3.7
MEDIAN = 2.0
"""Metres from the axis to the edge of the left lane."""
LEAD_IN = 260.0


def motorway(rng: np.random.Generator, duration: float) -> World:
    """Return three lanes each way with a barrier between, rails, gantries, a bridge now and then."""
    return _build(rng, duration, start=1.0, is_bare=True)


def slowdown(rng: np.random.Generator, duration: float) -> World:
    """Return a motorway with shrubs along it, on which a slow section has just ended."""
    return _build(rng, duration, start=SLOW, is_bare=False)


def _build(rng: np.random.Generator, duration: float, start: float, is_bare: bool) -> World:
    main = through(winding(rng, EGO_SPEED * duration + 2 * LEAD_IN, (300.0, 500.0), (2.0, 9.0)), radius=900.0)
    half = MEDIAN + 3 * LANE_WIDTH + 2.5  # with hard shoulder
    site = Site.over_hills(rng, ((2.0, 700.0), (0.4, 250.0)), (Road(main, half),), kerb=0.0, roughness=0.06)
    _populate(site, main, duration, start)
    _furnish(site, main, half)
    if not is_bare:
        for side in (-1.0, 1.0):
            roadside.place_thickets(site, main, (side * (half + 3.5), side * (half + 9.0)), (4.0, 16.0), (1.2, 3.0))
    return site.finish(duration, reach=110.0, unevenness=0.2)


def _lane(main: Path, k: int) -> Path:
    return main.beside(-(MEDIAN + (2.5 - k) * LANE_WIDTH))


def _populate(site: Site, main: Path, duration: float, start: float) -> None:
    """Fill both carriageways; all start at the share `start` of their speed."""
    lanes = [_lane(main, k) for k in range(3)]
    opposite = [_lane(main.reversed(), k) for k in range(3)]
    site.add_ego(lanes[1], LEAD_IN, EGO_SPEED, initial=start * EGO_SPEED, wander=0.15)
    for k, speed in enumerate(LANES):
        for side in (lanes, opposite):
            heavy = (0.55, 0.05, 0.0)[k]
            _change_lanes(site, side, k, speed, start)
            road_users.fill_lane(site, side[k], speed, (30.0, 110.0), heavy=heavy, spread=0.05, initial=start * speed)
            road_users.feed_lane(site, side[k], speed, (2.0, 6.0), duration, heavy=heavy)


def _change_lanes(site: Site, lanes: list[Path], k: int, speed: float, start: float) -> None:
    """Put in some cars that move over to the next lane on the left."""
    if k == 2:
        return
    for s in np.arange(60.0, lanes[k].length - 250.0, 220.0):
        s += site.rng.uniform(0.0, 100.0)
        path = lanes[k].shifted(s + site.rng.uniform(60.0, 200.0), 110.0, LANE_WIDTH)
        car = Agent((vehicles.make_car(site.rng),), path, s, speed * 1.1, initial=start * speed)
        road_users.add_agent(site, car, clearance=6.0)


def _furnish(site: Site, main: Path, half: float) -> None:
    rng = site.rng
    for x, y, heading in roadside.along(site, main, 0.0, (12.0, 12.0), -np.inf):
        site.add(furniture.make_barrier(12.05), x, y, heading)
    for side in (-1.0, 1.0):
        for x, y, heading in roadside.along(site, main, side * (half + 0.8), (16.0, 16.0), -np.inf):
            site.add(furniture.make_guard_rail(16.1), x, y, heading)
        for x, y, heading in roadside.along(site, main, side * (half + 1.8), (50.0, 50.0), -np.inf):
            site.add(furniture.make_delineator(), x, y, heading if side < 0 else heading + np.pi)
        roadside.scatter_bushes(site, main, (side * (half + 8.0), side * (half + 40.0)), (7.0, 20.0))
        roadside.place_trees(site, main, side * (half + 25.0), (12.0, 60.0), clearance=6.0)
        roadside.scatter_tufts(site, main, (side * (half + 2.5), side * (half + 18.0)), 0.4)
    for s in np.arange(LEAD_IN + rng.uniform(40.0, 150.0), main.length, 420.0):
        middle, turn = main.at(s)
        site.add(furniture.make_gantry(2 * half + 3.0), float(middle[0]), float(middle[1]), float(turn))
    for s in np.arange(LEAD_IN + rng.uniform(150.0, 320.0), main.length, 700.0):
        roadside.add_viaduct(site, main, s, clearance=6.0, span=2 * half + 60.0, clear_of=half)
