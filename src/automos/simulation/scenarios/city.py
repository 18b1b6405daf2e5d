"""A city street: parked rows, two-way traffic, cyclists, people on the pavements, side streets, bends.

Cars stand at the kerb and pull out, others drive up and park.
"""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.shapes.materials import Material
from automos.simulation.terrain import Road
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site, World

SPEED = 9.0
"""m/s of the traffic."""
LEAD_IN = 130.0
"""Metres of street behind the ego's start and beyond its end."""
LIFE = road_users.Life(heavy=0.08, arrive=140.0, leave=75.0)


def city(rng: np.random.Generator, duration: float) -> World:
    """Return a city street the ego drives along with the traffic."""
    return street(rng, duration, LIFE)


def street(rng: np.random.Generator, duration: float, life: road_users.Life) -> World:
    """Return a city street with a life of its own."""
    main = through(winding(rng, SPEED * duration + 2 * LEAD_IN, (110.0, 170.0), (8.0, 45.0)), radius=35.0)
    sides = side_streets(rng, main, (60.0, 100.0), 85.0)
    roads = (Road(main, 5.6, 3.0), *(Road(path, 3.6, 2.2) for path in sides))
    site = Site.over_hills(rng, ((0.4, 260.0), (0.06, 80.0)), roads, verge=Material.SOIL, roughness=0.03)
    _populate(site, main, duration, life)
    _furnish(site, main, sides, life)
    return site.finish(duration)


def winding(
    rng: np.random.Generator, length: float, pieces: tuple[float, float], turns_deg: tuple[float, float]
) -> np.ndarray:
    """Return (P, 2) corners of a road of about `length` metres whose pieces turn left and right in turn."""
    points, heading, side = [np.zeros(2)], 0.0, float(rng.choice([-1.0, 1.0]))
    while length > 0:
        piece = rng.uniform(*pieces)
        points.append(points[-1] + piece * np.array([np.cos(heading), np.sin(heading)]))
        heading += side * np.radians(rng.uniform(*turns_deg))
        side = -side
        length -= piece
    return np.array(points)


def side_streets(rng: np.random.Generator, main: Path, spacing: tuple[float, float], reach: float) -> list[Path]:
    """Return side streets that leave `main` on one or both sides, up to `reach` metres long."""
    streets, s = [], rng.uniform(*spacing)
    while s < main.length - 40.0:
        at, heading = main.at(s)
        across = heading + 0.5 * np.pi + np.radians(rng.uniform(-12.0, 12.0))
        along = np.array([np.cos(across), np.sin(across)])
        right, left = (reach if rng.random() < 0.75 else 0.0 for _ in range(2))
        if right + left > 0:
            streets.append(through([at - right * along, at + left * along]))
        s += rng.uniform(*spacing)
    return streets


def _furnish(site: Site, main: Path, sides: list[Path], life: road_users.Life) -> None:
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
    for street in sides:
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, street, side, 7.0, (2, 5), gap_chance=0.5)
            road_users.park_row(site, street, side * 2.7, 0.35, start=12.0, vans=life.vans)


def _populate(site: Site, main: Path, duration: float, life: road_users.Life) -> None:
    with_ego, oncoming = main.beside(-1.75), main.reversed().beside(-1.75)
    site.add_ego(with_ego, LEAD_IN, SPEED, wander=0.1)
    for lane in (with_ego, oncoming):
        road_users.pull_out(site, lane, SPEED, 2.85, (LEAD_IN + 30.0, lane.length - LEAD_IN), life.leave, duration)
        road_users.drive_and_park(site, lane, SPEED, 2.85, (LEAD_IN + 60.0, lane.length - LEAD_IN), life.arrive)
    road_users.fill_lane(site, with_ego, SPEED, (25.0, 75.0), heavy=life.heavy)
    road_users.fill_lane(site, oncoming, SPEED * 1.05, (22.0, 75.0), heavy=life.heavy)
    for lane in (with_ego, oncoming):
        road_users.add_cyclists(site, lane, max(2, int(lane.length / 90.0)), offset=-1.1)
    for side in (-1.0, 1.0):
        road_users.add_walkers(site, main.beside(side * 7.6), int(main.length / 14.0), 0.5, parties=life.parties)
        road_users.add_standers(site, main, side * 8.6, int(main.length / 80.0))
