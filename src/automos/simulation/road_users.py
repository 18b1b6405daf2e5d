"""Filling a road with those who use it: vehicles in lanes, at the kerb and in queues, cyclists, people."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from automos.simulation.shapes import people, vehicles
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path
from automos.simulation.world import Site, is_clear

PAIRS = {2: 0.25, 1: 0.75}
"""Shares of people on foot by how many go together."""


@dataclass(frozen=True)
class Life:
    """What goes on in a street.

    Attributes
    ----------
    heavy : share of the vehicles that are lorries, buses and articulated lorries.
    arrive, leave : metres of kerb between cars that drive up and park, and between those that pull out.
    vans : share of what stands at the kerb that hides what is behind it.
    parties : shares of people on foot by how many go together.
    """

    heavy: float
    arrive: float
    leave: float
    vans: float = 0.08
    parties: Mapping[int, float] = field(default_factory=lambda: PAIRS)


def a_vehicle(rng: np.random.Generator, heavy: float = 0.12) -> tuple[tuple[Thing, ...], tuple[float, ...]]:
    """Return (parts, gaps) of a random vehicle, `heavy` being the share of lorries, buses and articulated lorries."""
    if rng.random() < heavy:
        kind = rng.random()
        if kind < 0.4:
            return (vehicles.make_lorry(rng),), (0.0,)
        if kind < 0.7:
            return (vehicles.make_bus(rng),), (0.0,)
        return vehicles.make_tractor_and_trailer(rng), (0.0, vehicles.TRAILER_GAP)
    light = rng.random()
    if light < 0.04:
        return (people.make_motorcyclist(rng),), (0.0,)
    return ((vehicles.make_van(rng) if light < 0.16 else vehicles.make_car(rng)),), (0.0,)


def add_tram(site: Site, path: Path, start: float, speed: float, initial: float | None = None) -> None:
    """Put an articulated tram of three cars on a path."""
    parts = tuple(vehicles.make_tram_car(site.rng, vehicles.TRAM_CAR) for _ in range(3))
    gaps = tuple((vehicles.TRAM_CAR + 0.5) * k for k in range(3))
    add_agent(site, Agent(parts, path, start, speed, initial, gaps=gaps, wander=0.0))


@lru_cache(maxsize=4)
def _walker_templates(seed: int) -> tuple[Thing, ...]:
    rng = np.random.default_rng([seed, 4])
    return tuple(people.make_walker(rng, child=k == 0) for k in range(10))


def a_walker(rng: np.random.Generator) -> Thing:
    """Return a person on foot, one of a few."""
    templates = _walker_templates(0)
    return templates[int(rng.integers(len(templates)))]


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
    heavy: float = 0.12,
    spread: float = 0.12,
    initial: float = np.inf,
) -> None:
    """Put vehicles on a lane at random spacings (metres, bumper to bumper)."""
    rng = site.rng
    s = start + rng.uniform(0.0, spacing[1])
    while s < path.length - 15.0:
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


def add_walkers(
    site: Site,
    path: Path,
    n: int,
    spread: float,
    speed: tuple[float, float] = (0.9, 1.6),
    parties: Mapping[int, float] = PAIRS,
) -> None:
    """Let `n` parties of people walk along a path, up to `spread` metres to either side of it, three abreast."""
    rng = site.rng
    templates = _walker_templates(0)
    back = path.reversed()
    for _ in range(n):
        line = back if rng.random() < 0.5 else path
        s, offset, pace = (
            rng.uniform(1.0, max(path.length - 5.0, 2.0)),
            rng.uniform(-spread, spread),
            rng.uniform(*speed),
        )
        company = list(parties)[int(np.searchsorted(np.cumsum(list(parties.values())), rng.random(), side="right"))]
        for k in range(company):
            thing = templates[int(rng.integers(len(templates)))]
            beside = offset + 0.7 * (k % 3) * (1.0 if offset < 0 else -1.0)
            walker = Agent((thing,), line, s - 0.9 * (k // 3), pace, offset=beside, wander=0.1, on_foot=True)
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
    site: Site, lane: Path, speed: float, aside: float, part: tuple[float, float], spacing: float, duration: float
) -> None:
    """Let cars stand `aside` metres right of a lane and pull out at some time, every `spacing` metres of a part."""
    rng = site.rng
    kerb = lane.beside(-aside)
    for s in np.arange(part[0] + rng.uniform(0.0, 20.0), part[1], spacing):
        path = kerb.shifted(s + 2.0, 14.0, aside)
        for ahead in (0.0, 5.0, 9.0):
            site.reserve(*kerb.at(s + ahead)[0])
        go = rng.uniform(1.0, max(0.5 * duration, 2.0))
        add_agent(site, Agent((vehicles.make_car(rng),), path, s, speed, initial=0.0, go=go, wander=0.0), clearance=0.3)


def drive_and_park(
    site: Site, lane: Path, speed: float, aside: float, part: tuple[float, float], spacing: float
) -> None:
    """Let cars drive along a lane and park `aside` metres to its right, every `spacing` metres of a part."""
    rng = site.rng
    for s in np.arange(part[0] + rng.uniform(0.0, 20.0), part[1], spacing):
        path = lane.shifted(s - 18.0, 15.0, -aside)
        start = s - rng.uniform(30.0, 80.0)
        agent = Agent((vehicles.make_car(rng),), path, start, speed, stop=s, wander=0.0)
        if add_agent(site, agent):
            for behind in (0.0, 5.0, 10.0):
                site.reserve(*lane.at(s - behind, -aside)[0])


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
