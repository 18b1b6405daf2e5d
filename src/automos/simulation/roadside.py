"""Furnishing a road: rows of houses, parked cars, trees, lamps, and the people and vehicles that use it.

Each function walks along a path and sets up one kind of thing at given or random spacings, wherever no carriageway is
in the way.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from automos.simulation import buildings, furniture, people, vegetation, vehicles
from automos.simulation.agents import Agent
from automos.simulation.mesh import Mesh
from automos.simulation.paths import Path, through
from automos.simulation.things import Thing
from automos.simulation.world import Site, is_clear

Maker = Callable[[np.random.Generator], Thing]


# ------------------------------------------------------------------------------------------------------- what stands
def along(
    site: Site, path: Path, offset: float, spacing: tuple[float, float], clearance: float, start: float = 0.0
) -> list[tuple[float, float, float]]:
    """Return (x, y, heading) of places `offset` metres left of `path`, at random `spacing`, clear of carriageways."""
    places = []
    s = start + site.rng.uniform(0.0, spacing[1])
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
        corners, headings = path.at([s, s + width, s + 0.5 * width], side * back)
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


@lru_cache(maxsize=8)
def _tree_templates(seed: int) -> tuple[Mesh, ...]:
    rng = np.random.default_rng([seed, 3])
    return tuple(vegetation.make_tree(rng, rng.uniform(6.0, 12.0)) for _ in range(8))


def a_tree(site: Site, seed: int = 0, size: float = 1.0) -> Mesh:
    """Return a tree: one of a few grown shapes, turned and stretched at random."""
    rng = site.rng
    tree = _tree_templates(seed)[int(rng.integers(8))]
    scale = size * rng.uniform(0.8, 1.2)
    return tree.scaled((scale, scale, scale * rng.uniform(0.9, 1.1))).moved(yaw=rng.uniform(0, 2 * np.pi))


def place_trees(
    site: Site,
    path: Path,
    offset: float,
    spacing: tuple[float, float],
    clearance: float = 0.7,
    size: float = 1.0,
    sway: float = 0.0,
) -> None:
    """Plant trees along a path; with `sway` (radians) they rock in the wind."""
    for x, y, _ in along(site, path, offset, spacing, clearance):
        if sway > 0:
            site.sway(a_tree(site, size=size), x, y, sway)
        else:
            site.add(a_tree(site, size=size), x, y)


def scatter_bushes(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float], sway: float = 0.0
) -> None:
    """Scatter bushes between two offsets (metres left of the path)."""
    for x, y, heading in along(site, path, 0.0, spacing, -np.inf):
        off = site.rng.uniform(min(offsets), max(offsets))
        x, y = x - off * np.sin(heading), y + off * np.cos(heading)
        radius = site.rng.uniform(0.4, 1.3)
        if site.terrain.road_distance(np.array([[x, y]]))[0] < radius + 0.5:
            continue
        bush = vegetation.make_bush(site.rng, radius, radius * site.rng.uniform(1.0, 1.9))
        if sway > 0:
            site.sway(bush, x, y, sway)
        else:
            site.add(bush, x, y)


def place_thickets(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float], heights: tuple[float, float]
) -> None:
    """Grow tall shrubs between two offsets: the edge of a wood."""
    rng = site.rng
    templates = [vegetation.make_thicket(rng, 0.35 * h + 0.3, h) for h in rng.uniform(*heights, 8)]
    for x, y, heading in along(site, path, 0.0, spacing, -np.inf):
        off = rng.uniform(min(offsets), max(offsets))
        x, y = x - off * np.sin(heading), y + off * np.cos(heading)
        if site.terrain.road_distance(np.array([[x, y]]))[0] > 2.5:
            site.add(templates[int(rng.integers(8))].scaled(rng.uniform(0.8, 1.2)), x, y, rng.uniform(0, 2 * np.pi))


def scatter_tufts(site: Site, path: Path, offsets: tuple[float, float], per_metre: float) -> None:
    """Scatter high grass between two offsets."""
    rng = site.rng
    templates = [vegetation.make_tuft(rng, rng.uniform(0.3, 0.9), rng.uniform(0.15, 0.6)) for _ in range(12)]
    n = int(per_metre * path.length)
    xy, _ = path.at(rng.uniform(0, path.length, n), rng.uniform(min(offsets), max(offsets), n))
    free = site.terrain.road_distance(xy) > 1.0
    for (x, y), z in zip(xy[free], site.terrain.height(xy[free]), strict=True):
        site.add(templates[int(rng.integers(len(templates)))], x, y, rng.uniform(0, 2 * np.pi), z=z)


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
    site: Site, path: Path, offset: float, fill: float, crosswise: bool = False, start: float = 0.0, end: float = np.inf
) -> None:
    """Park cars along a path, `offset` metres to its left, taking the share `fill` of the places."""
    rng = site.rng
    pitch = 2.6 if crosswise else 6.2
    s = start + rng.uniform(1.0, 4.0)
    side = np.sign(offset) or 1.0
    while s < min(end, path.length - 3.0):
        (x, y), heading = path.at(s, offset + rng.normal(0.0, 0.08))
        (ax, ay), _ = path.at([s - 4.5, s + 4.5], offset)
        distances = site.terrain.road_distance(np.array([(ax[0], ax[1]), (ay[0], ay[1]), (x, y)]))
        at_kerb = np.ptp(distances) < 0.8  # a junction mouth is no place to park
        if rng.random() < fill and at_kerb and site.is_free(float(x), float(y), 2.5):
            thing = vehicles.make_van(rng) if rng.random() < 0.08 else vehicles.make_car(rng)
            turn = side * 0.5 * np.pi if crosswise else 0.0
            flip = np.pi if rng.random() < (0.5 if crosswise else 0.0) or (side > 0 and not crosswise) else 0.0
            site.park(thing, float(x), float(y), float(heading) + turn + flip + rng.normal(0.0, 0.02))
        s += pitch * rng.uniform(0.97, 1.15)


# -------------------------------------------------------------------------------------------------------- what moves
def a_vehicle(rng: np.random.Generator, heavy: float = 0.12) -> tuple[tuple[Thing, ...], tuple[float, ...]]:
    """Return (parts, gaps) of a random vehicle, `heavy` being the share of lorries, buses and articulated lorries."""
    if rng.random() < heavy:
        kind = rng.random()
        if kind < 0.4:
            return (vehicles.make_lorry(rng),), (0.0,)
        if kind < 0.7:
            return (vehicles.make_bus(rng),), (0.0,)
        return vehicles.make_tractor_and_trailer(rng), (0.0, vehicles.TRAILER_GAP)
    return ((vehicles.make_van(rng) if rng.random() < 0.12 else vehicles.make_car(rng)),), (0.0,)


def add_agent(site: Site, agent: Agent, clearance: float = 1.5) -> bool:
    """Add the agent if it starts clear of the others; return whether it was added."""
    if not is_clear(site.agents, agent, clearance):
        return False
    site.agents.append(agent)
    return True


def fill_lane(
    site: Site,
    path: Path,
    speed: float,
    spacing: tuple[float, float],
    start: float = 25.0,
    end: float = np.inf,
    heavy: float = 0.12,
    spread: float = 0.12,
    initial: float = np.inf,
) -> None:
    """Put vehicles on a lane at random spacings (metres, bumper to bumper)."""
    rng = site.rng
    s = start + rng.uniform(0.0, spacing[1])
    while s < min(end, path.length - 15.0):
        parts, gaps = a_vehicle(rng, heavy)
        wish = speed * float(np.clip(rng.normal(1.0, spread), 0.7, 1.35))
        agent = Agent(parts, path, s, wish, initial=min(wish, speed, initial), gaps=gaps, headway=rng.uniform(1.0, 1.6))
        add_agent(site, agent)
        s += agent.front + agent.rear + rng.uniform(*spacing)


def feed_lane(
    site: Site, path: Path, speed: float, interval: tuple[float, float], duration: float, heavy: float = 0.12
) -> None:
    """Let vehicles enter at the start of a lane at random intervals (seconds)."""
    rng = site.rng
    t = rng.uniform(*interval)
    while t < duration:
        parts, gaps = a_vehicle(rng, heavy)
        site.agents.append(Agent(parts, path, 22.0, speed * rng.uniform(0.9, 1.15), enter=t, gaps=gaps))
        t += rng.uniform(*interval)


@lru_cache(maxsize=4)
def _walker_templates(seed: int) -> tuple[Thing, ...]:
    rng = np.random.default_rng([seed, 4])
    return tuple(people.make_walker(rng, child=k == 0) for k in range(10))


def add_walkers(
    site: Site, path: Path, n: int, spread: float, speed: tuple[float, float] = (0.9, 1.6), both_ways: bool = True
) -> None:
    """Let `n` people walk along a path, up to `spread` metres to either side of it; some in pairs."""
    rng = site.rng
    templates = _walker_templates(0)
    back = path.reversed()
    for _ in range(n):
        line = back if both_ways and rng.random() < 0.5 else path
        s, offset, pace = (
            rng.uniform(1.0, max(path.length - 5.0, 2.0)),
            rng.uniform(-spread, spread),
            rng.uniform(*speed),
        )
        company = 2 if rng.random() < 0.25 else 1
        for k in range(company):
            thing = templates[int(rng.integers(len(templates)))]
            beside = offset + (0.7 * k if offset < 0 else -0.7 * k)
            walker = Agent((thing,), line, s, pace, offset=beside, wander=0.1, on_foot=True)
            add_agent(site, walker, clearance=0.15)


def add_standers(site: Site, path: Path, offset: float, n: int) -> None:
    """Let `n` people stand about near a path; they do not move."""
    rng = site.rng
    for _ in range(n):
        (x, y), heading = path.at(rng.uniform(0, path.length), offset + rng.normal(0, 0.4))
        if site.is_free(float(x), float(y), 0.6):
            site.park(people.make_stander(rng), float(x), float(y), float(heading + rng.uniform(0, 2 * np.pi)))


def add_cyclists(site: Site, path: Path, n: int, speed: tuple[float, float] = (3.5, 6.5), offset: float = 0.0) -> None:
    """Let `n` cyclists ride along a path."""
    rng = site.rng
    for _ in range(n):
        rider = people.make_cyclist(rng)
        s = rng.uniform(5.0, path.length - 10.0)
        add_agent(
            site,
            Agent((rider,), path, s, rng.uniform(*speed), offset=offset + rng.normal(0, 0.15), wander=0.2, headway=1.0),
        )


def pull_out(
    site: Site, lane: Path, speed: float, aside: float, stretch: tuple[float, float], spacing: float, duration: float
) -> None:
    """Let cars stand `aside` metres right of a lane and pull out at some time, every `spacing` metres of a stretch."""
    rng = site.rng
    kerb = lane.beside(-aside)
    for s in np.arange(stretch[0] + rng.uniform(0.0, 20.0), stretch[1], spacing):
        path = kerb.shifted(s + 2.0, 14.0, aside)
        for ahead in (0.0, 5.0, 9.0):
            site.reserve(*kerb.at(s + ahead)[0])
        go = rng.uniform(1.0, max(0.5 * duration, 2.0))
        add_agent(site, Agent((vehicles.make_car(rng),), path, s, speed, initial=0.0, go=go, wander=0.0), clearance=0.3)


def drive_and_park(
    site: Site, lane: Path, speed: float, aside: float, stretch: tuple[float, float], spacing: float
) -> None:
    """Let cars drive along a lane and park `aside` metres to its right, every `spacing` metres of a stretch."""
    rng = site.rng
    for s in np.arange(stretch[0] + rng.uniform(0.0, 20.0), stretch[1], spacing):
        path = lane.shifted(s - 18.0, 15.0, -aside)
        start = s - rng.uniform(30.0, 80.0)
        agent = Agent((vehicles.make_car(rng),), path, start, speed, stop=s, wander=0.0)
        if add_agent(site, agent):
            for behind in (0.0, 5.0, 10.0):
                site.reserve(*lane.at(s - behind, -aside)[0])


def a_walker(rng: np.random.Generator) -> Thing:
    """Return a person on foot, one of a few."""
    templates = _walker_templates(0)
    return templates[int(rng.integers(len(templates)))]


def add_viaduct(
    site: Site, path: Path, at: float, clearance: float, span: float, clear_of: float, busy: bool = False
) -> None:
    """Bridge the road at arc length `at`; with `busy`, cars drive over it."""
    (x, y), heading = path.at(at)
    across = float(heading) + 0.5 * np.pi + site.rng.uniform(-0.3, 0.3)
    deck = float(site.terrain.base(np.array([[x, y]]))[0])
    site.add(furniture.make_viaduct(span, 9.0, clearance, clear_of), float(x), float(y), across, z=deck)
    if not busy:
        return
    along_deck = 0.5 * span * np.array([np.cos(across), np.sin(across)])
    line = through([(x, y) - along_deck, (x, y) + along_deck])
    for lane in (line.beside(-1.9), line.reversed().beside(-1.9)):
        level = deck + clearance + furniture.DECK_THICKNESS - site.terrain.base(lane.xy)
        fill_lane(site, Path(lane.xy, level), 11.0, (10.0, 40.0), start=10.0, heavy=0.1)


def place_hedges(site: Site, path: Path, offset: float, share: float) -> None:
    """Plant clipped hedges along a `share` of a path."""
    rng = site.rng
    s = rng.uniform(0.0, 20.0)
    while s < path.length - 8.0:
        length = rng.uniform(5.0, 8.0)
        if rng.random() < share:
            (ends, _), height = path.at([s, s + 0.5 * length, s + length], offset), rng.uniform(0.8, 2.0)
            if site.terrain.road_distance(ends).min() > 0.8:
                turn = float(np.arctan2(*(ends[2] - ends[0])[::-1]))
                site.add(vegetation.make_hedge(rng, length, height), *map(float, ends[0]), turn)
        s += length


def place_houses(site: Site, path: Path, offset: float, spacing: tuple[float, float]) -> None:
    """Set up detached houses with a fence or wall before them."""
    rng = site.rng
    side = np.sign(offset)
    for x, y, heading in along(site, path, offset, spacing, 8.0):
        turn = heading if side > 0 else heading + np.pi
        site.add(buildings.make_house(rng), x, y, turn)
        front = np.array([x, y]) + 7.0 * np.array([np.sin(turn), -np.cos(turn)])
        if site.terrain.road_distance(front[None])[0] > 1.0:
            fence = (
                buildings.make_fence(rng, 14.0)
                if rng.random() < 0.5
                else buildings.make_wall(rng, 14.0, rng.uniform(0.6, 1.4))
            )
            site.add(fence, float(front[0]), float(front[1]), turn)
