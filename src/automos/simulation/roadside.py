"""Furnishing a road: houses, walls, lamps, signs, bridges, and what grows beside it.

Each function walks along a path and sets up one kind of thing at given or random spacings, wherever no carriageway is
in the way. Of what grows, a few shapes are made and used many times.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial

import numpy as np

from automos.simulation.shapes import buildings, furniture, people
from automos.simulation.shapes.mesh import Mesh
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


def place_row(
    site: Site,
    path: Path,
    side: float,
    offset: float,
    spacing: tuple[float, float],
    clearance: float,
    make: Callable[[], Mesh],
) -> None:
    """Set up one kind of thing that looks towards the road from one `side` (+1 left, -1 right) of it."""
    for x, y, heading in along(site, path, side * offset, spacing, clearance):
        site.add(make(), x, y, heading if side > 0 else heading + np.pi)


def place_lamps(site: Site, path: Path, side: float, offset: float, spacing: float = 28.0) -> None:
    """Set up street lamps whose arms reach over the road."""
    make = partial(furniture.make_lamp, site.rng)
    place_row(site, path, side, offset, (0.9 * spacing, 1.1 * spacing), 0.2, make)


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


CAR = 2.4
"""Metres around the middle of a standing thing that nothing grows in."""


@cache
def _tree_templates() -> tuple[Mesh, ...]:
    rng = np.random.default_rng([0, 3])
    return tuple(furniture.make_tree(rng, rng.uniform(6.0, 12.0)) for _ in range(8))


def a_tree(site: Site) -> Mesh:
    """Return a tree: one of a few grown shapes, turned and stretched at random."""
    rng = site.rng
    tree = _tree_templates()[int(rng.integers(8))]
    scale = rng.uniform(0.8, 1.2)
    return tree.scaled((scale, scale, scale * rng.uniform(0.9, 1.1))).moved(yaw=rng.uniform(0, 2 * np.pi))


def place_trees(
    site: Site,
    path: Path,
    offset: float,
    spacing: tuple[float, float],
    clearance: float = 0.7,
    sway: float = 0.0,
) -> None:
    """Plant trees along a path; with `sway` (radians) they rock in the wind."""
    for x, y, _ in along(site, path, offset, spacing, clearance):
        if site.is_free(x, y, CAR):
            _plant(site, a_tree(site), x, y, sway)


def _plant(site: Site, plant: Mesh, x: float, y: float, sway: float) -> None:
    if sway > 0:
        site.sway(plant, x, y, sway)
    else:
        site.add(plant, x, y)


def _between(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float]
) -> Iterator[tuple[float, float]]:
    """Yield places (x, y) at random between two offsets (metres left of the path)."""
    for x, y, heading in along(site, path, 0.0, spacing, -np.inf):
        off = site.rng.uniform(min(offsets), max(offsets))
        yield x - off * np.sin(heading), y + off * np.cos(heading)


def scatter_bushes(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float], sway: float = 0.0
) -> None:
    """Scatter bushes between two offsets (metres left of the path)."""
    for x, y in _between(site, path, offsets, spacing):
        radius = site.rng.uniform(0.4, 1.3)
        if site.terrain.road_distance(np.array([[x, y]]))[0] >= radius + 0.5 and site.is_free(x, y, radius + CAR):
            bush = furniture.make_bush(site.rng, radius, radius * site.rng.uniform(1.0, 1.9))
            _plant(site, bush, x, y, sway)


def place_thickets(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float], heights: tuple[float, float]
) -> None:
    """Grow tall shrubs between two offsets: the edge of a wood."""
    rng = site.rng
    templates = [furniture.make_thicket(rng, 0.35 * h + 0.3, h) for h in rng.uniform(*heights, 8)]
    for x, y in _between(site, path, offsets, spacing):
        if site.terrain.road_distance(np.array([[x, y]]))[0] > 2.5 and site.is_free(x, y, 1.5 + CAR):
            site.add(templates[int(rng.integers(8))].scaled(rng.uniform(0.8, 1.2)), x, y, rng.uniform(0, 2 * np.pi))


def scatter_tufts(site: Site, path: Path, offsets: tuple[float, float], per_metre: float) -> None:
    """Scatter high grass between two offsets."""
    rng = site.rng
    templates = [furniture.make_tuft(rng, rng.uniform(0.3, 0.9), rng.uniform(0.15, 0.6)) for _ in range(12)]
    n = int(per_metre * path.length)
    xy, _ = path.at(rng.uniform(0, path.length, n), rng.uniform(min(offsets), max(offsets), n))
    free = site.terrain.road_distance(xy) > 1.0
    for (x, y), z in zip(xy[free], site.terrain.height(xy[free]), strict=True):
        if site.is_free(x, y, CAR):
            site.add(templates[int(rng.integers(len(templates)))], x, y, rng.uniform(0, 2 * np.pi), z=z)


def place_hedges(site: Site, path: Path, offset: float, share: float) -> None:
    """Plant clipped hedges along a `share` of a path."""
    rng = site.rng
    s = rng.uniform(0.0, 20.0)
    while s < path.length - 8.0:
        length = rng.uniform(5.0, 8.0)
        if rng.random() < share:
            (ends, _), height = path.at([s, s + 0.5 * length, s + length], offset), rng.uniform(0.8, 2.0)
            if site.terrain.road_distance(ends).min() > 0.8 and site.is_free(
                float(ends[1, 0]), float(ends[1, 1]), 0.5 * length + 1.0
            ):
                turn = float(np.arctan2(*(ends[2] - ends[0])[::-1]))
                x, y = ends[0].tolist()
                site.add(furniture.make_hedge(rng, length, height), x, y, turn)
        s += length
