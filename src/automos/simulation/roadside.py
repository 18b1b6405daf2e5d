"""Furnishing a road: houses, walls, lamps, signs, bridges, and what grows beside it.

Each function walks along a path and sets up one kind of thing at given or random spacings, wherever no carriageway is
in the way. Of what grows, a few shapes are made and used many times.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial

import numpy as np

from automos.core.geometry import Array
from automos.simulation.shapes import buildings, furniture, people
from automos.simulation.shapes.mesh import Mesh
from automos.simulation.traffic.paths import Path, Range, every, through
from automos.simulation.world import Site


def along(site: Site, path: Path, offset: float, spacing: Range, clearance: float) -> list[tuple[Array, float]]:
    """Return places and headings `offset` metres left of `path`, at random `spacing`, clear of carriageways."""
    rng = site.rng
    places = [path.at(s, offset) for s in every(rng, spacing, rng.uniform(0.0, spacing[1]), path.length)]
    return [(at, float(heading)) for at, heading in places if site.terrain.road_distance(at[None])[0] > clearance]


def place_buildings(
    site: Site,
    path: Path,
    side: float,
    setback: float,
    storeys: tuple[int, int],
    widths: Range = (10.0, 22.0),
    gap_chance: float = 0.25,
    gaps: Range = (4.0, 14.0),
    smooth: bool = False,
) -> None:
    """Line the `side` (+1 left, -1 right) of `path` with buildings whose fronts stand `setback` metres off its line."""
    rng, terrain = site.rng, site.terrain
    s = rng.uniform(0.0, 5.0)
    while s < path.length - widths[0]:
        width, depth = rng.uniform(*widths), rng.uniform(9.0, 14.0)
        back = setback + rng.uniform(0.0, 0.4 if smooth else 1.0)
        front, _ = path.at([s, s + width, s + 0.5 * width], side * back)
        rear, _ = path.at(s + 0.5 * width, side * (back + depth))
        probes = np.array([*front, rear, 0.5 * (front[0] + rear), 0.5 * (front[1] + rear)])
        distances = terrain.road_distance(probes)
        if distances.min() > min(2.5, 0.85 * distances[2]):
            building = buildings.make_building(rng, width, depth, int(rng.integers(storeys[0], storeys[1] + 1)), smooth)
            heading = np.arctan2(*(front[1] - front[0])[::-1])
            corner, z = front[0 if side > 0 else 1], terrain.base(probes).min() + terrain.kerb
            site.add(building, corner, _facing(heading, side), z)
        s += width + (rng.uniform(*gaps) if rng.random() < gap_chance else 0.02)


def _facing(heading: float, side: float) -> float:
    """Return the yaw of what looks towards the road from one `side` (+1 left, -1 right) of it."""
    return heading if side > 0 else heading + np.pi


def place_houses(site: Site, path: Path, offset: float, spacing: Range) -> None:
    """Set up detached houses with a fence or wall before them."""
    rng = site.rng
    for place, heading in along(site, path, offset, spacing, 8.0):
        turn = _facing(heading, offset)
        site.add(buildings.make_house(rng), place, turn)
        along_front, inward = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        for a, b in ((2.0, 2.0), (2.0, 8.0), (7.0, 2.0), (7.0, 8.0), (12.0, 3.0)):  # nothing grows in it
            site.reserve(place + a * along_front + b * inward)
        front = place - 7.0 * inward
        if site.terrain.road_distance(front[None])[0] > 1.0:
            is_fence = rng.random() < 0.5
            fence = buildings.make_fence(rng, 14.0) if is_fence else buildings.make_wall(rng, 14.0)
            site.add(fence, front, turn)


def place_row(
    site: Site, path: Path, side: float, offset: float, spacing: Range, clearance: float, make: Callable[[], Mesh]
) -> None:
    """Set up one kind of thing that looks towards the road from one `side` (+1 left, -1 right) of it."""
    for place, heading in along(site, path, side * offset, spacing, clearance):
        site.add(make(), place, _facing(heading, side))


def place_lamps(site: Site, path: Path, side: float, offset: float, spacing: float = 28.0) -> None:
    """Set up street lamps whose arms reach over the road."""
    make = partial(furniture.make_lamp, site.rng)
    place_row(site, path, side, offset, (0.9 * spacing, 1.1 * spacing), 0.2, make)


def place_clutter(site: Site, path: Path, side: float, offset: float, spacing: Range = (8.0, 25.0)) -> None:
    """Set up signs, bollards, bins, benches, cabinets, parked bicycles and scooters on a pavement."""
    rng = site.rng
    sign, cabinet = partial(furniture.make_sign, rng), partial(furniture.make_cabinet, rng)
    makers = (sign, furniture.make_bollard, furniture.make_bin, furniture.make_bench, cabinet)
    for place, heading in along(site, path, side * offset, spacing, 0.3):
        if rng.random() < 0.3:
            maker = people.make_parked_bicycle if rng.random() < 0.7 else people.make_parked_scooter
            site.park(maker(rng), place, heading + rng.choice([0.0, np.pi]) + rng.normal(0, 0.2))
        else:
            site.add(makers[int(rng.integers(len(makers)))](), place, _facing(heading, side))


def add_viaduct(site: Site, path: Path, at: float, clearance: float, span: float, clear_of: float) -> list[Path]:
    """Bridge the road at arc length `at` and return the two lanes over the bridge."""
    middle, heading = path.at(at)
    across = float(heading) + 0.5 * np.pi + site.rng.uniform(-0.3, 0.3)
    foot = site.terrain.base(middle[None])[0]
    site.add(furniture.make_viaduct(span, 9.0, clearance, clear_of), middle, across, foot)
    half = 0.5 * span * np.array([np.cos(across), np.sin(across)])
    line = through([middle - half, middle + half])
    deck = foot + clearance + furniture.DECK_THICKNESS
    lanes = (lane.beside(-1.9) for lane in (line, line.reversed()))
    return [Path(lane.xy, deck - site.terrain.base(lane.xy)) for lane in lanes]


CAR = 2.4
"""Metres around the middle of a standing thing that nothing grows in."""


@cache
def _tree_templates() -> tuple[Mesh, ...]:
    rng = np.random.default_rng([0, 3])
    return tuple(furniture.make_tree(rng, rng.uniform(6.0, 12.0)) for _ in range(8))


def place_trees(
    site: Site, path: Path, offset: float, spacing: Range, clearance: float = 0.7, sway: float = 0.0
) -> None:
    """Plant trees along a path: a few grown shapes, turned and stretched; with `sway` (radians) the wind rocks them."""
    rng = site.rng
    for place, _ in along(site, path, offset, spacing, clearance):
        if site.is_free(place, CAR):
            tree, scale = _tree_templates()[int(rng.integers(8))], rng.uniform(0.8, 1.2)
            tree = tree.scaled((scale, scale, scale * rng.uniform(0.9, 1.1))).moved(yaw=rng.uniform(0, 2 * np.pi))
            site.plant(tree, place, sway)


def _between(site: Site, path: Path, offsets: Range, spacing: Range) -> Iterator[Array]:
    """Yield places (x, y) at random between two offsets (metres left of the path)."""
    for place, heading in along(site, path, 0.0, spacing, -np.inf):
        off = site.rng.uniform(min(offsets), max(offsets))
        yield place + off * np.array([-np.sin(heading), np.cos(heading)])


def scatter_bushes(site: Site, path: Path, offsets: Range, spacing: Range, sway: float = 0.0) -> None:
    """Scatter bushes between two offsets (metres left of the path)."""
    for place in _between(site, path, offsets, spacing):
        radius = site.rng.uniform(0.4, 1.3)
        if site.terrain.road_distance(place[None])[0] >= radius + 0.5 and site.is_free(place, radius + CAR):
            bush = furniture.make_bush(site.rng, radius, radius * site.rng.uniform(1.0, 1.9))
            site.plant(bush, place, sway)


def place_thickets(site: Site, path: Path, offsets: Range, spacing: Range, heights: Range) -> None:
    """Grow tall shrubs between two offsets: the edge of a wood."""
    rng = site.rng
    templates = [furniture.make_thicket(rng, 0.35 * h + 0.3, h) for h in rng.uniform(*heights, 8)]
    for place in _between(site, path, offsets, spacing):
        if site.terrain.road_distance(place[None])[0] > 2.5 and site.is_free(place, 1.5 + CAR):
            shrub = templates[int(rng.integers(8))].scaled(rng.uniform(0.8, 1.2))
            site.add(shrub, place, rng.uniform(0, 2 * np.pi))


def scatter_tufts(site: Site, path: Path, offsets: Range, per_metre: float) -> None:
    """Scatter high grass between two offsets."""
    rng = site.rng
    templates = [furniture.make_tuft(rng, rng.uniform(0.3, 0.9), rng.uniform(0.15, 0.6)) for _ in range(12)]
    n = int(per_metre * path.length)
    xy, _ = path.at(rng.uniform(0, path.length, n), rng.uniform(min(offsets), max(offsets), n))
    free = site.terrain.road_distance(xy) > 1.0
    for place, z in zip(xy[free], site.terrain.height(xy[free]), strict=True):
        if site.is_free(place, CAR):
            site.add(templates[int(rng.integers(len(templates)))], place, rng.uniform(0, 2 * np.pi), z)


def place_hedges(site: Site, path: Path, offset: float, share: float) -> None:
    """Plant clipped hedges along a `share` of a path."""
    rng = site.rng
    s = rng.uniform(0.0, 20.0)
    while s < path.length - 8.0:
        length = rng.uniform(5.0, 8.0)
        if rng.random() < share:
            (points, _), height = path.at([s, s + 0.5 * length, s + length], offset), rng.uniform(0.8, 2.0)
            start, middle, end = points
            if site.terrain.road_distance(points).min() > 0.8 and site.is_free(middle, 0.5 * length + 1.0):
                turn = np.arctan2(*(end - start)[::-1])
                site.add(furniture.make_hedge(rng, length, height), start, turn)
        s += length
