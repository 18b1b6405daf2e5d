"""Street canyons: dense traffic at the ego's speed. Along smooth façades odometry is tempted to drive with the traffic.

`canyon` is long smooth walls and little else, and starts as a light turns green, when all that moves moves alike. On
`avenue` traffic flows from the start, and shorter houses with trees before them show how far along the street it is.
"""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.shapes.materials import Material
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import through
from automos.simulation.world import Site, World

SPEED = 11.0
AT_GREEN = 3.0
"""m/s at which the platoon around the ego starts where a light has just turned green."""
LEAD_IN = 140.0
LANE = 3.3


def canyon(rng: np.random.Generator, duration: float) -> World:
    """Return a straight four-lane street between long smooth walls of buildings."""
    return _street(rng, duration, AT_GREEN, widths=(40.0, 90.0), gap_chance=0.2)


def avenue(rng: np.random.Generator, duration: float) -> World:
    """Return the same street with rows of trees, with gaps between the buildings, and in full flow."""
    return _street(rng, duration, SPEED, widths=(20.0, 45.0), gap_chance=0.4, has_trees=True)


def _street(
    rng: np.random.Generator,
    duration: float,
    start: float,
    widths: tuple[float, float],
    gap_chance: float,
    has_trees: bool = False,
) -> World:
    """Return a street full of vehicles, the ego's lanes at `start` m/s at first, between buildings of some `widths`."""
    length = SPEED * duration + 2 * LEAD_IN
    main = through([(0.0, 0.0), (length, 0.0)])
    site = Site.over_hills(rng, ((0.3, 400.0),), (Road(main, 7.2, 3.0),), verge=Material.PAVEMENT)
    back = main.reversed()
    inner, outer = main.beside(-0.5 * LANE), main.beside(-1.5 * LANE)
    site.add_ego(outer, LEAD_IN, SPEED, initial=start, wander=0.08)
    road_users.add_tram(site, inner, LEAD_IN + site.rng.uniform(15.0, 45.0), SPEED, start)
    road_users.add_tram(site, back.beside(-0.5 * LANE), 0.5 * length - site.rng.uniform(20.0, 60.0), SPEED)
    for lane in (inner, outer):
        road_users.fill_lane(site, lane, SPEED, (7.0, 18.0), heavy=0.25, spread=0.02, initial=start)
    for lane in (back.beside(-0.5 * LANE), back.beside(-1.5 * LANE)):
        road_users.fill_lane(site, lane, SPEED, (10.0, 30.0), heavy=0.2, spread=0.03)
    for side in (-1.0, 1.0):
        roadside.place_buildings(
            site, main, side, 10.4, (6, 9), widths=widths, gap_chance=gap_chance, gaps=(3.0, 7.0), smooth=True
        )
        if has_trees:
            roadside.place_trees(site, main, side * 7.9, (16.0, 34.0), clearance=0.4)
        road_users.add_walkers(site, main.beside(side * 8.8), int(main.length / 18.0), 0.5)
        roadside.place_lamps(site, main, side, 7.7, spacing=28.0)
        roadside.place_clutter(site, main, side, 9.9, spacing=(12.0, 35.0))
    return site.finish(duration)
