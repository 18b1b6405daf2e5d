"""A road over hills, under trees and bridges, past bushes that sway: uneven ground, things above the road."""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import winding
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

SPEED = 12.0
LEAD_IN = 130.0
WIND = 0.025
"""Radians by which trees rock; bushes rock four times as much."""


def hills(rng: np.random.Generator, duration: float) -> World:
    """Return a winding road over hills with an overpass."""
    main = through(winding(rng, SPEED * duration + 2 * LEAD_IN, (70.0, 130.0), (10.0, 35.0)), radius=60.0)
    waves = ((2.2, 160.0), (2.2, 170.0), (0.8, 80.0))
    site = Site.over_hills(rng, waves, (Road(main, 3.6),), kerb=0.0, roughness=0.06)
    with_ego, oncoming = main.beside(-1.75), main.reversed().beside(-1.75)
    site.add_ego(with_ego, LEAD_IN, SPEED, wander=0.1)
    road_users.fill_lane(site, with_ego, SPEED, (25.0, 80.0), heavy=0.15)
    road_users.fill_lane(site, oncoming, SPEED, (20.0, 70.0), heavy=0.15)
    road_users.add_cyclists(site, with_ego, int(main.length / 150.0) + 1, speed=(4.0, 8.0), offset=-1.1)
    _furnish(site, main)
    return site.finish(duration, reach=120.0, unevenness=0.5)


def _furnish(site: Site, main: Path) -> None:
    for s in np.arange(LEAD_IN + 50.0, main.length - 30.0, 180.0):
        for lane in roadside.add_viaduct(site, main, s, clearance=5.5, span=80.0, clear_of=4.5):
            road_users.fill_lane(site, lane, SPEED, (10.0, 40.0), start=10.0)
    for side in (-1.0, 1.0):
        for offset, spacing in ((5.4, (7.0, 16.0)), (11.0, (6.0, 14.0)), (20.0, (6.0, 14.0)), (34.0, (7.0, 18.0))):
            sway = WIND if offset < 6.0 else 0.0
            roadside.place_trees(site, main, side * offset, spacing, clearance=1.3, sway=sway)
        roadside.scatter_bushes(site, main, (side * 5.0, side * 9.0), (5.0, 12.0), sway=4 * WIND)
        roadside.scatter_bushes(site, main, (side * 8.0, side * 30.0), (3.0, 8.0))
        roadside.scatter_tufts(site, main, (side * 4.4, side * 14.0), 1.2)
        roadside.place_hedges(site, main, side * 6.5, 0.25)
