"""Roads out of town: one where nothing moves, so that every moving label is wrong, and one over hills.

On `hills`, the ground is uneven, and there is something above the road: trees, and bridges. Bushes sway.
"""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import side_streets, winding
from automos.simulation.shapes import furniture, vehicles
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

COUNTRY, HILLS = 14.0, 12.0
"""m/s of the traffic."""
LEAD_IN = 130.0
WIND = 0.025
"""Radians by which trees rock; bushes rock four times as much."""


def country(rng: np.random.Generator, duration: float) -> World:
    """Return a road past verges, woods, hedges, farms and parked cars."""
    main = through(winding(rng, COUNTRY * duration + 2 * LEAD_IN, (120.0, 220.0), (5.0, 25.0)), radius=120.0)
    tracks = side_streets(rng, main, (90.0, 200.0), 50.0)
    roads = (Road(main, 3.4), *(Road(path, 2.0) for path in tracks))
    site = Site.over_hills(rng, ((1.0, 260.0), (0.25, 60.0)), roads, kerb=0.0, roughness=0.08)
    site.add_ego(main.beside(-1.6), LEAD_IN, COUNTRY, wander=0.1)
    _furnish_country(site, main, tracks)
    return site.finish(duration, reach=120.0, unevenness=0.4)


def _furnish_country(site: Site, main: Path, tracks: list[Path]) -> None:
    rng = site.rng
    for track in tracks:
        road_users.park_row(site, track, 3.2, 0.3, start=15.0)
        road_users.add_standers(site, track, rng.uniform(-3.0, 3.0), 1)
    for x, y, heading in roadside.along(site, main, -5.3, (60.0, 140.0), 0.8):
        site.park(vehicles.make_car(rng), x, y, heading + rng.normal(0.0, 0.05))
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
        for x, y, heading in roadside.along(site, main, side * 4.6, (50.0, 50.0), 0.4):
            site.add(furniture.make_delineator(), x, y, heading if side < 0 else heading + np.pi)


def hills(rng: np.random.Generator, duration: float) -> World:
    """Return a winding road over hills with an overpass."""
    main = through(winding(rng, HILLS * duration + 2 * LEAD_IN, (70.0, 130.0), (10.0, 35.0)), radius=60.0)
    waves = ((2.2, 160.0), (2.2, 170.0), (0.8, 80.0))
    site = Site.over_hills(rng, waves, (Road(main, 3.6),), kerb=0.0, roughness=0.06)
    with_ego, oncoming = main.beside(-1.75), main.reversed().beside(-1.75)
    site.add_ego(with_ego, LEAD_IN, HILLS, wander=0.1)
    road_users.fill_lane(site, with_ego, HILLS, (25.0, 80.0), heavy=0.15)
    road_users.fill_lane(site, oncoming, HILLS, (20.0, 70.0), heavy=0.15)
    road_users.add_cyclists(site, with_ego, int(main.length / 150.0) + 1, speed=(4.0, 8.0), offset=-1.1)
    _furnish_hills(site, main)
    return site.finish(duration, reach=120.0, unevenness=0.5)


def _furnish_hills(site: Site, main: Path) -> None:
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
