"""Furnishing a road with what is built: houses, walls, lamps, signs, bridges, parked cars.

Each function walks along a path and sets up one kind of thing at given or random spacings, wherever no carriageway is
in the way.
"""

import numpy as np

from automos.simulation.shapes import buildings, furniture, people, vehicles
from automos.simulation.traffic.paths import Path, through
from automos.simulation.world import Site


def along(
    site: Site, path: Path, offset: float, spacing: tuple[float, float], clearance: float
) -> list[tuple[float, float, float]]:
    """Return (x, y, heading) of places `offset` metres left of `path`, at random `spacing`, clear of carriageways."""
    places = []
    s = site.rng.uniform(0.0, spacing[1])
    while s < path.length:
        (x, y), heading = path.at(s, offset)
        if site.terrain.road_distance(np.array([[x, y]]))[0] > clearance:
            places.append((float(x), float(y), float(heading)))
        s += site.rng.uniform(*spacing)
    return places


def place_buildings(
    site: Site,
    path: Path,
    side: float,
    setback: float,
    storeys: tuple[int, int],
    widths: tuple[float, float] = (10.0, 22.0),
    gap_chance: float = 0.25,
    gaps: tuple[float, float] = (4.0, 14.0),
    smooth: bool = False,
) -> None:
    """Line the `side` (+1 left, -1 right) of `path` with buildings whose fronts stand `setback` metres off its line."""
    rng = site.rng
    s = rng.uniform(0.0, 5.0)
    while s < path.length - widths[0]:
        width, depth = rng.uniform(*widths), rng.uniform(9.0, 14.0)
        back = setback + rng.uniform(0.0, 0.4 if smooth else 1.0)
        corners, _ = path.at([s, s + width, s + 0.5 * width], side * back)
        (rear_x, rear_y), _ = path.at(s + 0.5 * width, side * (back + depth))
        probes = np.array(
            [*corners, (rear_x, rear_y), 0.5 * (corners[0] + (rear_x, rear_y)), 0.5 * (corners[1] + (rear_x, rear_y))]
        )
        front = float(site.terrain.road_distance(path.at([s + 0.5 * width], side * back)[0])[0])
        if site.terrain.road_distance(probes).min() > min(2.5, 0.85 * front):
            building = buildings.make_building(rng, width, depth, int(rng.integers(storeys[0], storeys[1] + 1)), smooth)
            heading = np.arctan2(*(corners[1] - corners[0])[::-1])
            x, y = corners[0] if side > 0 else corners[1]
            z = float(min(site.terrain.base(probes)))
            site.add(building, x, y, heading if side > 0 else heading + np.pi, z=z + site.terrain.kerb)
        s += width + (rng.uniform(*gaps) if rng.random() < gap_chance else 0.02)


def place_houses(site: Site, path: Path, offset: float, spacing: tuple[float, float]) -> None:
    """Set up detached houses with a fence or wall before them."""
    rng = site.rng
    side = np.sign(offset)
    for x, y, heading in along(site, path, offset, spacing, 8.0):
        turn = heading if side > 0 else heading + np.pi
        site.add(buildings.make_house(rng), x, y, turn)
        along_front, inward = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        for a, b in ((2.0, 2.0), (2.0, 8.0), (7.0, 2.0), (7.0, 8.0), (12.0, 3.0)):  # nothing grows in it
            site.reserve(*(np.array([x, y]) + a * along_front + b * inward))
        front = np.array([x, y]) + 7.0 * np.array([np.sin(turn), -np.cos(turn)])
        if site.terrain.road_distance(front[None])[0] > 1.0:
            fence = (
                buildings.make_fence(rng, 14.0)
                if rng.random() < 0.5
                else buildings.make_wall(rng, 14.0, rng.uniform(0.6, 1.4))
            )
            site.add(fence, float(front[0]), float(front[1]), turn)


def place_lamps(site: Site, path: Path, side: float, offset: float, spacing: float = 28.0) -> None:
    """Set up street lamps whose arms reach over the road."""
    for x, y, heading in along(site, path, side * offset, (0.9 * spacing, 1.1 * spacing), 0.2):
        site.add(furniture.make_lamp(site.rng), x, y, heading if side > 0 else heading + np.pi)


def place_clutter(
    site: Site, path: Path, side: float, offset: float, spacing: tuple[float, float] = (8.0, 25.0)
) -> None:
    """Set up signs, bollards, bins, benches, cabinets, parked bicycles and scooters on a pavement."""
    rng = site.rng
    makers = [
        lambda: furniture.make_sign(rng),
        furniture.make_bollard,
        furniture.make_bin,
        furniture.make_bench,
        lambda: furniture.make_cabinet(rng),
    ]
    for x, y, heading in along(site, path, side * offset, spacing, 0.3):
        if rng.random() < 0.3:
            maker = people.make_parked_bicycle if rng.random() < 0.7 else people.make_parked_scooter
            site.park(maker(rng), x, y, heading + rng.choice([0.0, np.pi]) + rng.normal(0, 0.2))
        else:
            site.add(makers[int(rng.integers(len(makers)))](), x, y, heading if side > 0 else heading + np.pi)


def park_row(
    site: Site,
    path: Path,
    offset: float,
    fill: float,
    crosswise: bool = False,
    start: float = 0.0,
    vans: float = 0.08,
) -> None:
    """Park cars, and `vans` of them vans, `offset` metres left of a path, taking the share `fill` of the places."""
    rng = site.rng
    pitch = 2.6 if crosswise else 6.2
    s = start + rng.uniform(1.0, 4.0)
    side = np.sign(offset) or 1.0
    while s < path.length - 3.0:
        (x, y), heading = path.at(s, offset + rng.normal(0.0, 0.08))
        (ax, ay), _ = path.at([s - 4.5, s + 4.5], offset)
        distances = site.terrain.road_distance(np.array([(ax[0], ax[1]), (ay[0], ay[1]), (x, y)]))
        at_kerb = np.ptp(distances) < 0.8  # a junction mouth is no place to park
        if rng.random() < fill and at_kerb and site.is_free(float(x), float(y), 2.5):
            thing = vehicles.make_van(rng) if rng.random() < vans else vehicles.make_car(rng)
            turn = side * 0.5 * np.pi if crosswise else 0.0
            flip = np.pi if rng.random() < (0.5 if crosswise else 0.0) or (side > 0 and not crosswise) else 0.0
            site.park(thing, float(x), float(y), float(heading) + turn + flip + rng.normal(0.0, 0.02))
        s += pitch * rng.uniform(0.97, 1.15)


def add_viaduct(site: Site, path: Path, at: float, clearance: float, span: float, clear_of: float) -> tuple[Path, Path]:
    """Bridge the road at arc length `at` and return the two lanes over the bridge."""
    (x, y), heading = path.at(at)
    across = float(heading) + 0.5 * np.pi + site.rng.uniform(-0.3, 0.3)
    foot = float(site.terrain.base(np.array([[x, y]]))[0])
    site.add(furniture.make_viaduct(span, 9.0, clearance, clear_of), float(x), float(y), across, z=foot)
    half = 0.5 * span * np.array([np.cos(across), np.sin(across)])
    line = through([np.array([x, y]) - half, np.array([x, y]) + half])
    lanes = (lane.beside(-1.9) for lane in (line, line.reversed()))
    deck = foot + clearance + furniture.DECK_THICKNESS
    right, left = (Path(lane.xy, deck - site.terrain.base(lane.xy)) for lane in lanes)
    return right, left
