"""Filling a road with those who use it: vehicles in lanes, at the kerb and in queues, cyclists, people."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from automos.simulation.shapes import people, vehicles
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.paths import Path, Range, every
from automos.simulation.world import Site

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


def a_vehicle(rng: np.random.Generator, heavy: float = 0.12) -> tuple[Thing, ...]:
    """Return the parts of a random vehicle, `heavy` being the share of lorries, buses and articulated lorries."""
    is_heavy, kind = rng.random() < heavy, rng.random()
    if is_heavy and kind >= 0.7:
        return vehicles.make_tractor_and_trailer(rng)
    if is_heavy:
        return (vehicles.make_lorry(rng) if kind < 0.4 else vehicles.make_bus(rng),)
    if kind < 0.04:
        return (people.make_motorcyclist(rng),)
    return (vehicles.make_van(rng) if kind < 0.16 else vehicles.make_car(rng),)


def add_tram(site: Site, path: Path, start: float, speed: float, initial: float | None = None) -> None:
    """Put an articulated tram of three cars on a path."""
    cars = tuple(vehicles.make_tram_car(site.rng) for _ in range(3))
    site.add_agent(Agent(cars, path, start, speed, initial, wander=0.0))


@cache
def _walkers() -> tuple[Thing, ...]:
    rng = np.random.default_rng([0, 4])
    return tuple(people.make_walker(rng, child=k == 0) for k in range(10))


def a_walker(rng: np.random.Generator) -> Thing:
    """Return a person on foot, one of a few."""
    return _walkers()[int(rng.integers(len(_walkers())))]


def fill_lane(
    site: Site,
    path: Path,
    speed: float,
    spacing: Range,
    start: float = 25.0,
    heavy: float = 0.12,
    spread: float = 0.12,
    initial: float = np.inf,
) -> None:
    """Put vehicles on a lane at random spacings (metres, bumper to bumper)."""
    rng = site.rng
    s = start + rng.uniform(0.0, spacing[1])
    while s < path.length - 15.0:
        parts = a_vehicle(rng, heavy)
        wish = speed * float(np.clip(rng.normal(1.0, spread), 0.7, 1.35))
        agent = Agent(parts, path, s, wish, initial=min(wish, speed, initial), headway=rng.uniform(1.0, 1.6))
        site.add_agent(agent)
        s += agent.front + agent.rear + rng.uniform(*spacing)


def feed_lane(site: Site, path: Path, speed: float, interval: Range, duration: float, heavy: float) -> None:
    """Let vehicles enter at the start of a lane at random intervals (seconds)."""
    rng = site.rng
    for t in every(rng, interval, rng.uniform(*interval), duration):
        site.agents.append(Agent(a_vehicle(rng, heavy), path, 22.0, speed * rng.uniform(0.9, 1.15), enter=t))


def add_walkers(
    site: Site, path: Path, n: int, spread: float, speed: Range = (0.9, 1.6), parties: Mapping[int, float] = PAIRS
) -> None:
    """Let `n` parties of people walk along a path, up to `spread` metres to either side of it, three abreast."""
    rng = site.rng
    back = path.reversed()
    up_to = np.cumsum(list(parties.values()))
    for _ in range(n):
        line = back if rng.random() < 0.5 else path
        s, offset = rng.uniform(1.0, max(path.length - 5.0, 2.0)), rng.uniform(-spread, spread)
        pace = rng.uniform(*speed)
        company = list(parties)[int(np.searchsorted(up_to, rng.random(), side="right"))]
        for k in range(company):
            start, beside = s - 0.9 * (k // 3), offset + 0.7 * (k % 3) * (1.0 if offset < 0 else -1.0)
            walker = Agent((a_walker(rng),), line, start, pace, offset=beside, wander=0.1, on_foot=True)
            site.add_agent(walker, clearance=0.15)


def add_standers(site: Site, path: Path, offset: float, n: int) -> None:
    """Let `n` people stand about near a path; they do not move."""
    rng = site.rng
    for _ in range(n):
        place, heading = path.at(rng.uniform(0, path.length), offset + rng.normal(0, 0.4))
        if site.is_free(place, 0.6):
            site.park(people.make_stander(rng), place, float(heading) + rng.uniform(0, 2 * np.pi))


def add_cyclists(site: Site, path: Path, n: int, speed: Range = (3.5, 6.5), offset: float = 0.0) -> None:
    """Let `n` cyclists ride along a path."""
    rng = site.rng
    for _ in range(n):
        rider, s, pace = people.make_cyclist(rng), rng.uniform(5.0, path.length - 10.0), rng.uniform(*speed)
        beside = offset + rng.normal(0, 0.15)
        site.add_agent(Agent((rider,), path, s, pace, offset=beside, wander=0.2, headway=1.0))


def pull_out(site: Site, lane: Path, speed: float, aside: float, part: Range, spacing: float, duration: float) -> None:
    """Let cars stand `aside` metres right of a lane and pull out at some time, every `spacing` metres of a part."""
    rng = site.rng
    kerb = lane.beside(-aside)
    for s in np.arange(part[0] + rng.uniform(0.0, 20.0), part[1], spacing):
        path = kerb.shifted(s + 2.0, 14.0, aside)
        for ahead in (0.0, 5.0, 9.0):
            site.reserve(kerb.at(s + ahead)[0])
        go = rng.uniform(1.0, max(0.5 * duration, 2.0))
        site.add_agent(Agent((vehicles.make_car(rng),), path, s, speed, initial=0.0, go=go, wander=0.0), clearance=0.3)


def drive_and_park(site: Site, lane: Path, speed: float, aside: float, part: Range, spacing: float) -> None:
    """Let cars drive along a lane and park `aside` metres to its right, every `spacing` metres of a part."""
    rng = site.rng
    for s in np.arange(part[0] + rng.uniform(0.0, 20.0), part[1], spacing):
        path = lane.shifted(s - 18.0, 15.0, -aside)
        start = s - rng.uniform(30.0, 80.0)
        if site.add_agent(Agent((vehicles.make_car(rng),), path, start, speed, stop=s, wander=0.0)):
            for behind in (0.0, 5.0, 10.0):
                site.reserve(lane.at(s - behind, -aside)[0])


def park_row(site: Site, path: Path, offset: float, fill: float, start: float = 0.0, vans: float = 0.08) -> None:
    """Park cars, and `vans` of them vans, `offset` metres left of a path, taking the share `fill` of the places."""
    rng = site.rng
    s = start + rng.uniform(1.0, 4.0)
    while s < path.length - 3.0:
        place, heading = path.at(s, offset + rng.normal(0.0, 0.08))
        ends, _ = path.at([s - 4.5, s + 4.5], offset)
        at_kerb = np.ptp(site.terrain.road_distance(np.array([*ends, place]))) < 0.8  # no place to park: a junction
        if rng.random() < fill and at_kerb and site.is_free(place, 2.5):
            thing = vehicles.make_van(rng) if rng.random() < vans else vehicles.make_car(rng)
            rng.random()  # of no use, but without it the worlds of all seeds would be others
            site.park(thing, place, float(heading) + (np.pi if offset > 0 else 0.0) + rng.normal(0.0, 0.02))
        s += 6.2 * rng.uniform(0.97, 1.15)
