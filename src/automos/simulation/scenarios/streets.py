"""City streets: parked rows, two-way traffic, cyclists, people on the pavements, side streets, bends; and canyons.

In the `city`, cars stand at the kerb and pull out, others drive up and park. In a canyon traffic is dense and at the
ego's speed: along smooth façades odometry is tempted to drive with it. `canyon` is long smooth walls and little else,
and starts as a light turns green, when all that moves moves alike. On `avenue` traffic flows from the start, and
shorter houses with trees before them show how far along the street it is.
"""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.shapes.materials import Material
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import Path, Range, every, through
from automos.simulation.world import Site, World

CITY, CANYON = 9.0, 11.0
"""m/s of the traffic."""
AT_GREEN = 3.0
"""m/s at which the platoon around the ego starts where a light has just turned green."""
CITY_LEAD_IN, CANYON_LEAD_IN = 130.0, 140.0
"""Metres of street behind the ego's start and beyond its end."""
LANE = 3.3
"""Metres, width of a lane in a canyon."""


def city(rng: np.random.Generator, duration: float) -> World:
    """Return a city street the ego drives along with the traffic."""
    return street(rng, duration, road_users.Life(heavy=0.08, arrive=140.0, leave=75.0))


def street(rng: np.random.Generator, duration: float, life: road_users.Life) -> World:
    """Return a city street with a life of its own."""
    main = winding(rng, CITY * duration + 2 * CITY_LEAD_IN, (110.0, 170.0), (8.0, 45.0), radius=35.0)
    sides = side_streets(rng, main, (60.0, 100.0), 85.0)
    roads = (Road(main, 5.6, 3.0), *(Road(path, 3.6, 2.2) for path in sides))
    site = Site(rng, ((0.4, 260.0), (0.06, 80.0)), roads, verge=Material.SOIL, roughness=0.03)
    with_ego, oncoming = main.beside(-1.75), main.reversed().beside(-1.75)
    site.add_ego(with_ego, CITY_LEAD_IN, CITY, wander=0.1)
    for lane in (with_ego, oncoming):
        first, last = CITY_LEAD_IN + 30.0, lane.length - CITY_LEAD_IN
        road_users.pull_out(site, lane, CITY, 2.85, (first, last), life.leave, duration)
        road_users.drive_and_park(site, lane, CITY, 2.85, (first + 30.0, last), life.arrive)
    road_users.fill_lane(site, with_ego, CITY, (25.0, 75.0), heavy=life.heavy)
    road_users.fill_lane(site, oncoming, CITY * 1.05, (22.0, 75.0), heavy=life.heavy)
    for lane in (with_ego, oncoming):
        road_users.add_cyclists(site, lane, max(2, int(lane.length / 90.0)), offset=-1.1)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 7.6), int(main.length / 14.0), 0.5, parties=life.parties)
        road_users.add_standers(site, main, side * 8.6, int(main.length / 80.0))
    for side in (-1.0, 1.0):
        roadside.place_buildings(site, main, side, 9.9, (3, 5), gap_chance=0.6, gaps=(8.0, 26.0))
        roadside.place_buildings(site, main, side, 38.0, (2, 6), widths=(14.0, 30.0), gap_chance=0.7, gaps=(5.0, 25.0))
        roadside.place_trees(site, main, side * 6.2, (11.0, 24.0))
        roadside.place_trees(site, main, side * 30.0, (10.0, 30.0), clearance=4.0)
        roadside.place_lamps(site, main, side, 6.1)
        roadside.place_clutter(site, main, side, 9.0)
        road_users.park_row(site, main, side * 4.6, 0.6, vans=life.vans)
        roadside.scatter_bushes(site, main, (side * 14.0, side * 34.0), (4.0, 9.0))
        roadside.place_thickets(site, main, (side * 12.0, side * 36.0), (5.0, 12.0), (2.0, 4.5))
        roadside.place_hedges(site, main, side * 10.2, 0.5)
    for path in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, path, side, 7.0, (2, 5), gap_chance=0.5)
            road_users.park_row(site, path, side * 2.7, 0.35, start=12.0, vans=life.vans)
    return site.finish(duration)


def winding(rng: np.random.Generator, length: float, pieces: Range, turns_deg: Range, radius: float) -> Path:
    """Return a road of about `length` metres whose pieces turn left and right in turn, in bends of a `radius`."""
    points, heading, side = [np.zeros(2)], 0.0, rng.choice([-1.0, 1.0])
    while length > 0:
        piece = rng.uniform(*pieces)
        points.append(points[-1] + piece * np.array([np.cos(heading), np.sin(heading)]))
        heading += side * np.radians(rng.uniform(*turns_deg))
        side = -side
        length -= piece
    return through(points, radius)


def side_streets(rng: np.random.Generator, main: Path, spacing: Range, reach: float) -> list[Path]:
    """Return side streets that leave `main` on one or both sides, up to `reach` metres long."""
    streets = []
    for s in every(rng, spacing, rng.uniform(*spacing), main.length - 40.0):
        at, heading = main.at(s)
        across = heading + 0.5 * np.pi + np.radians(rng.uniform(-12.0, 12.0))
        along = np.array([np.cos(across), np.sin(across)])
        right, left = (reach if rng.random() < 0.75 else 0.0 for _ in range(2))
        if right + left > 0:
            streets.append(through([at - right * along, at + left * along]))
    return streets


def canyon(rng: np.random.Generator, duration: float) -> World:
    """Return a straight four-lane street between long smooth walls of buildings."""
    return _between_walls(rng, duration, AT_GREEN, widths=(40.0, 90.0), gap_chance=0.2, has_trees=False)


def avenue(rng: np.random.Generator, duration: float) -> World:
    """Return the same street with rows of trees, with gaps between the buildings, and in full flow."""
    return _between_walls(rng, duration, CANYON, widths=(20.0, 45.0), gap_chance=0.4, has_trees=True)


def _between_walls(
    rng: np.random.Generator, duration: float, start: float, widths: Range, gap_chance: float, has_trees: bool
) -> World:
    """Return a street full of vehicles, the ego's lanes at `start` m/s at first, between buildings of some `widths`."""
    length = CANYON * duration + 2 * CANYON_LEAD_IN
    main = through([(0.0, 0.0), (length, 0.0)])
    site = Site(rng, ((0.3, 400.0),), (Road(main, 7.2, 3.0),), verge=Material.PAVEMENT)
    inner, outer = main.beside(-0.5 * LANE), main.beside(-1.5 * LANE)
    back_inner, back_outer = main.reversed().beside(-0.5 * LANE), main.reversed().beside(-1.5 * LANE)
    site.add_ego(outer, CANYON_LEAD_IN, CANYON, initial=start, wander=0.08)
    road_users.add_tram(site, inner, CANYON_LEAD_IN + site.rng.uniform(15.0, 45.0), CANYON, start)
    road_users.add_tram(site, back_inner, 0.5 * length - site.rng.uniform(20.0, 60.0), CANYON)
    for lane in (inner, outer):
        road_users.fill_lane(site, lane, CANYON, (7.0, 18.0), heavy=0.25, spread=0.02, initial=start)
    for lane in (back_inner, back_outer):
        road_users.fill_lane(site, lane, CANYON, (10.0, 30.0), heavy=0.2, spread=0.03)
    for side in (-1.0, 1.0):
        roadside.place_buildings(site, main, side, 10.4, (6, 9), widths, gap_chance, gaps=(3.0, 7.0), smooth=True)
        if has_trees:
            roadside.place_trees(site, main, side * 7.9, (16.0, 34.0), clearance=0.4)
        road_users.add_walkers(site, main.beside(side * 8.8), int(main.length / 18.0), 0.5)
        roadside.place_lamps(site, main, side, 7.7, spacing=28.0)
        roadside.place_clutter(site, main, side, 9.9, spacing=(12.0, 35.0))
    return site.finish(duration)
