"""A country road where nothing moves: every moving label is wrong here."""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.scenarios.city import side_streets, winding
from automos.simulation.shapes import furniture, vehicles
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

SPEED = 14.0
LEAD_IN = 130.0


def country(rng: np.random.Generator, duration: float) -> World:
    """Return a road past verges, woods, hedges, farms and parked cars."""
    main = through(winding(rng, SPEED * duration + 2 * LEAD_IN, (120.0, 220.0), (5.0, 25.0)), radius=120.0)
    tracks = side_streets(rng, main, (90.0, 200.0), 50.0)
    roads = (Road(main, 3.4), *(Road(path, 2.0) for path in tracks))
    site = Site.over_hills(rng, ((1.0, 260.0), (0.25, 60.0)), roads, kerb=0.0, roughness=0.08)
    site.add_ego(main.beside(-1.6), LEAD_IN, SPEED, wander=0.1)
    _furnish(site, main, tracks)
    return site.finish(duration, reach=120.0, unevenness=0.4)


def _furnish(site: Site, main: Path, tracks: list[Path]) -> None:
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
