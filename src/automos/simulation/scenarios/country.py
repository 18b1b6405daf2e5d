"""Roads out of town: one where nothing moves, so that every moving label is wrong, one over hills, and motorways.

On `hills`, the ground is uneven, and there is something above the road: trees, and bridges. Bushes sway. On motorways
nearly everything moves, and fast, and little stands still to hold on to: on `motorway` all are in full flight from the
first scan, between bare verges; on `slowdown` all pick up speed after a slow section, between shrubs.
"""

from functools import partial

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.streets import side_streets, winding
from automos.simulation.shapes import furniture, vehicles
from automos.simulation.terrain import Road
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path
from automos.simulation.world import Site, World

COUNTRY, HILLS, MOTORWAY = 14.0, 12.0, 28.0
"""m/s of the ego."""
LANES = (24.0, 29.0, 34.0)
"""m/s on the right, middle and left lane of a motorway."""
SLOW = 0.6
"""Share of their speed at which all leave a slow section."""
LANE_WIDTH = 3.7
MEDIAN = 2.0
"""Metres from a motorway's axis to the edge of the left lane."""
LEAD_IN, MOTORWAY_LEAD_IN = 130.0, 260.0
"""Metres of road behind the ego's start and beyond its end."""
WIND = 0.025
"""Radians by which trees rock; bushes rock four times as much."""


def country(rng: np.random.Generator, duration: float) -> World:
    """Return a road past verges, woods, hedges, farms and parked cars."""
    main = winding(rng, COUNTRY * duration + 2 * LEAD_IN, (120.0, 220.0), (5.0, 25.0), radius=120.0)
    tracks = side_streets(rng, main, (90.0, 200.0), 50.0)
    roads = (Road(main, 3.4), *(Road(path, 2.0) for path in tracks))
    site = Site(rng, ((1.0, 260.0), (0.25, 60.0)), roads, kerb=0.0, roughness=0.08)
    site.add_ego(main.beside(-1.6), LEAD_IN, COUNTRY, wander=0.1)
    for track in tracks:
        road_users.park_row(site, track, 3.2, 0.3, start=15.0)
        road_users.add_standers(site, track, rng.uniform(-3.0, 3.0), 1)
    for place, heading in roadside.along(site, main, -5.3, (60.0, 140.0), 0.8):
        site.park(vehicles.make_car(rng), place, heading + rng.normal(0.0, 0.05))
    for side in (-1.0, 1.0):
        roadside.place_houses(site, main, side * 17.0, (60.0, 160.0))
    for side in (-1.0, 1.0):
        roadside.scatter_tufts(site, main, (side * 4.2, side * 9.0), 2.5)
        roadside.scatter_tufts(site, main, (side * 8.0, side * 22.0), 1.2)
        roadside.scatter_bushes(site, main, (side * 5.5, side * 14.0), (3.0, 8.0))
        roadside.place_thickets(site, main, (side * 8.0, side * 12.0), (2.5, 9.0), (1.8, 4.0))
        roadside.place_thickets(site, main, (side * 13.0, side * 19.0), (1.5, 5.0), (2.5, 6.0))
        roadside.place_thickets(site, main, (side * 22.0, side * 40.0), (2.5, 7.0), (3.0, 7.0))
        for offset, spacing in ((8.0, (9.0, 30.0)), (15.0, (6.0, 14.0)), (30.0, (7.0, 16.0))):
            roadside.place_trees(site, main, side * offset, spacing, clearance=2.0)
        roadside.place_hedges(site, main, side * 7.5, 0.15)
        roadside.place_row(site, main, -side, -4.6, (50.0, 50.0), 0.4, furniture.make_delineator)
    return site.finish(duration, reach=120.0, unevenness=0.4)


def hills(rng: np.random.Generator, duration: float) -> World:
    """Return a winding road over hills with an overpass."""
    main = winding(rng, HILLS * duration + 2 * LEAD_IN, (70.0, 130.0), (10.0, 35.0), radius=60.0)
    waves = ((2.2, 160.0), (2.2, 170.0), (0.8, 80.0))
    site = Site(rng, waves, (Road(main, 3.6),), kerb=0.0, roughness=0.06)
    with_ego, oncoming = main.beside(-1.75), main.reversed().beside(-1.75)
    site.add_ego(with_ego, LEAD_IN, HILLS, wander=0.1)
    road_users.fill_lane(site, with_ego, HILLS, (25.0, 80.0), heavy=0.15)
    road_users.fill_lane(site, oncoming, HILLS, (20.0, 70.0), heavy=0.15)
    road_users.add_cyclists(site, with_ego, int(main.length / 150.0) + 1, speed=(4.0, 8.0), offset=-1.1)
    for s in np.arange(LEAD_IN + 50.0, main.length - 30.0, 180.0):
        for lane in roadside.add_viaduct(site, main, s, clearance=5.5, span=80.0, clear_of=4.5):
            road_users.fill_lane(site, lane, HILLS, (10.0, 40.0), start=10.0)
    for side in (-1.0, 1.0):
        for offset, spacing in ((5.4, (7.0, 16.0)), (11.0, (6.0, 14.0)), (20.0, (6.0, 14.0)), (34.0, (7.0, 18.0))):
            sway = WIND if offset < 6.0 else 0.0
            roadside.place_trees(site, main, side * offset, spacing, clearance=1.3, sway=sway)
        roadside.scatter_bushes(site, main, (side * 5.0, side * 9.0), (5.0, 12.0), sway=4 * WIND)
        roadside.scatter_bushes(site, main, (side * 8.0, side * 30.0), (3.0, 8.0))
        roadside.scatter_tufts(site, main, (side * 4.4, side * 14.0), 1.2)
        roadside.place_hedges(site, main, side * 6.5, 0.25)
    return site.finish(duration, reach=120.0, unevenness=0.5)


def motorway(rng: np.random.Generator, duration: float) -> World:
    """Return three lanes each way with a barrier between, rails, gantries, a bridge now and then."""
    return _motorway(rng, duration, start=1.0, is_bare=True)


def slowdown(rng: np.random.Generator, duration: float) -> World:
    """Return a motorway with shrubs along it, on which a slow section has just ended."""
    return _motorway(rng, duration, start=SLOW, is_bare=False)


def _motorway(rng: np.random.Generator, duration: float, start: float, is_bare: bool) -> World:
    """Return a motorway on which all begin at the share `start` of their speed."""
    main = winding(rng, MOTORWAY * duration + 2 * MOTORWAY_LEAD_IN, (300.0, 500.0), (2.0, 9.0), radius=900.0)
    half = MEDIAN + 3 * LANE_WIDTH + 2.5  # with hard shoulder
    site = Site(rng, ((2.0, 700.0), (0.4, 250.0)), (Road(main, half),), kerb=0.0, roughness=0.06)
    lanes, opposite = (
        [axis.beside(-(MEDIAN + (2.5 - k) * LANE_WIDTH)) for k in range(3)] for axis in (main, main.reversed())
    )
    site.add_ego(lanes[1], MOTORWAY_LEAD_IN, MOTORWAY, initial=start * MOTORWAY, wander=0.15)
    for k, (speed, heavy) in enumerate(zip(LANES, (0.55, 0.05, 0.0), strict=True)):
        for lane in (lanes[k], opposite[k]):
            if k < 2:
                _change_lanes(site, lane, speed, start)
            road_users.fill_lane(site, lane, speed, (30.0, 110.0), heavy=heavy, spread=0.05, initial=start * speed)
            road_users.feed_lane(site, lane, speed, (2.0, 6.0), duration, heavy)
    roadside.place_row(site, main, 1.0, 0.0, (12.0, 12.0), -np.inf, partial(furniture.make_barrier, 12.05))
    for side in (-1.0, 1.0):
        for place, heading in roadside.along(site, main, side * (half + 0.8), (16.0, 16.0), -np.inf):
            site.add(furniture.make_guard_rail(16.1), place, heading)
        roadside.place_row(site, main, -side, -(half + 1.8), (50.0, 50.0), -np.inf, furniture.make_delineator)
        roadside.scatter_bushes(site, main, (side * (half + 8.0), side * (half + 40.0)), (7.0, 20.0))
        roadside.place_trees(site, main, side * (half + 25.0), (12.0, 60.0), clearance=6.0)
        roadside.scatter_tufts(site, main, (side * (half + 2.5), side * (half + 18.0)), 0.4)
    for s in np.arange(MOTORWAY_LEAD_IN + rng.uniform(40.0, 150.0), main.length, 420.0):
        middle, turn = main.at(s)
        site.add(furniture.make_gantry(2 * half + 3.0), middle, float(turn))
    for s in np.arange(MOTORWAY_LEAD_IN + rng.uniform(150.0, 320.0), main.length, 700.0):
        roadside.add_viaduct(site, main, s, clearance=6.0, span=2 * half + 60.0, clear_of=half)
    if not is_bare:
        for side in (-1.0, 1.0):
            roadside.place_thickets(site, main, (side * (half + 3.5), side * (half + 9.0)), (4.0, 16.0), (1.2, 3.0))
    return site.finish(duration, reach=110.0, unevenness=0.2)


def _change_lanes(site: Site, lane: Path, speed: float, start: float) -> None:
    """Put in some cars that move over to the next lane on the left."""
    for s in np.arange(60.0, lane.length - 250.0, 220.0):
        s += site.rng.uniform(0.0, 100.0)
        path = lane.shifted(s + site.rng.uniform(60.0, 200.0), 110.0, LANE_WIDTH)
        car = Agent((vehicles.make_car(site.rng),), path, s, speed * 1.1, initial=start * speed)
        site.add_agent(car, clearance=6.0)
