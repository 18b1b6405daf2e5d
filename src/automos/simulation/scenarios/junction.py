"""A signalled junction: cars that wait and then drive, cars that drive and then park, people crossing.

`junction` is driven through; at `waiting` a sensor stands still and sees everything from one place only. `lights`,
`kerbside` and `outing` last half a minute and longer, for objects: each is seen long enough to wait, hide, part and
come back, among long vehicles, people in pairs and groups, and vans that hide the rest.
"""

import numpy as np

from automos.simulation import road_users, roadside
from automos.simulation.road_users import Life
from automos.simulation.scenarios.streets import street
from automos.simulation.shapes import furniture
from automos.simulation.shapes.materials import Material
from automos.simulation.terrain import Road
from automos.simulation.traffic.agents import LANE, STOP, Agent, Crossing
from automos.simulation.world import Site, World

SPEED = 10.0
LIFE = Life(heavy=0.1, arrive=45.0, leave=60.0)


def junction(rng: np.random.Generator, duration: float) -> World:
    """Return a junction the ego drives up to, waits at, and leaves by a left turn."""
    return cross(rng, duration, 3, 36.0, LIFE)


def cross(rng: np.random.Generator, duration: float, leave_by: int, shift: float, life: Life) -> World:
    """Return a junction from whose arm 0 the ego goes to one long enough for it; the lights are `shift` s ahead."""
    crossing, site = make_site(rng, shift, leave_by, SPEED * duration + 130.0)
    way = crossing.way(0, leave_by)
    site.add_ego(way, crossing.reaches[0] - STOP - 55.0, SPEED, wander=0.05)
    site.signals.append(crossing.light(0, way))
    populate(site, crossing, duration, life)
    furnish(site, crossing, life)
    return site.finish(duration)


def make_site(rng: np.random.Generator, shift: float, long_arm: int = -1, length: float = 0.0) -> tuple[Crossing, Site]:
    """Return a four-armed crossing that is not quite square, one arm perhaps of another length, and its ground."""
    headings = np.pi + 0.5 * np.pi * np.arange(4) + np.radians(rng.uniform(-8.0, 8.0, 4))
    crossing = Crossing(headings, [length if k == long_arm else 150.0 for k in range(4)], shift)
    roads = tuple(Road(crossing.arm(k), 5.8, 3.2) for k in range(4))
    site = Site(rng, ((0.3, 220.0),), roads, verge=Material.PAVEMENT, roughness=0.02, corner=9.0)
    return crossing, site


def populate(site: Site, crossing: Crossing, duration: float, life: Life) -> None:
    """Bring in traffic on all arms in all directions, people who cross, cars that park and that leave."""
    rng = site.rng
    arms = range(len(crossing.headings))
    ways = {(i, j): crossing.way(i, j) for i in arms for j in arms if i != j}
    site.signals += [crossing.light(i, way) for (i, _), way in ways.items()]
    for i in arms:
        s, room = crossing.reaches[i] - STOP - rng.uniform(2.0, 12.0), 0.0
        while s > 20.0:
            j = int(rng.choice([j for j in arms if j != i]))
            parts = road_users.a_vehicle(rng, life.heavy)
            is_queue = s > crossing.reaches[i] - STOP - 40.0
            pace = min(SPEED, np.sqrt(2.0 * room))  # slow enough to stop behind whoever stands ahead
            agent = Agent(parts, ways[i, j], s, SPEED * rng.uniform(0.9, 1.2), 0.0 if is_queue else pace)
            site.add_agent(agent)
            room = rng.uniform(2.0, 5.0) if is_queue else rng.uniform(12.0, 40.0)
            s -= agent.front + agent.rear + room + 4.0 * (not is_queue)
        for t in np.arange(rng.uniform(0.0, 5.0), duration, 6.0):
            j = int(rng.choice([j for j in arms if j != i]))
            parts = road_users.a_vehicle(rng, life.heavy)
            site.agents.append(Agent(parts, ways[i, j], 22.0, SPEED, enter=t + 0.1))
        out = crossing.arm(i).beside(-LANE)
        road_users.drive_and_park(site, out, SPEED, 2.9, (35.0, min(out.length, 140.0) - 15.0), life.arrive)
        road_users.pull_out(site, out, SPEED, 2.9, (28.0, out.length - 40.0), life.leave, duration)
        road_users.add_cyclists(site, ways[i, (i + 2) % len(arms)], 2, offset=-1.2)
        _add_people(site, crossing, i, life)


def _add_people(site: Site, crossing: Crossing, k: int, life: Life) -> None:
    rng = site.rng
    for path in (crossing.walk(k), crossing.walk(k).reversed()):
        kerb = 14.0 - 6.3
        site.signals.append(crossing.walk_light(path, kerb))
        for _ in range(int(rng.integers(2, 5))):
            walker, start = road_users.a_walker(rng), rng.uniform(0.5, kerb - 0.6)
            offset, pace = rng.uniform(-1.3, 1.3), rng.uniform(1.0, 1.6)
            agent = Agent((walker,), path, start, pace, offset=offset, wander=0.05, on_foot=True)
            site.add_agent(agent, clearance=0.1)
    for side in (-1.0, 1.0):
        pavement, n = crossing.arm(k, side * 7.6, inner=14.0), max(4, int(crossing.reaches[k] / 22.0))
        road_users.add_walkers(site, pavement, n, 0.8, parties=life.parties)
        road_users.add_standers(site, crossing.arm(k, inner=15.0), side * 8.3, 1)


def furnish(site: Site, crossing: Crossing, life: Life) -> None:
    """Set up houses, parked cars, trees, lamps and lights along all arms."""
    for k in range(len(crossing.headings)):
        arm = crossing.arm(k, inner=14.0)
        for side in (-1.0, 1.0):
            roadside.place_buildings(site, arm, side, 10.5, (3, 6), gap_chance=0.3)
            roadside.place_buildings(site, arm, side, 36.0, (3, 7), (15.0, 30.0), gap_chance=0.7, gaps=(5.0, 20.0))
            road_users.park_row(site, arm, side * 4.7, 0.65, start=12.0, vans=life.vans)
            roadside.place_trees(site, arm, side * 7.0, (12.0, 26.0))
            roadside.place_lamps(site, arm, side, 6.3)
            roadside.place_clutter(site, arm, side, 9.0)
        for side in (1.0, -1.0):
            place, heading = crossing.arm(k).at(STOP + 0.5, side * 6.4)
            site.add(furniture.make_signal(), place, float(heading) + np.pi)


def waiting(rng: np.random.Generator, duration: float) -> World:
    """Return a junction watched from a vehicle that stands at the kerb of one arm and never moves."""
    return watch(rng, duration, LIFE)


def watch(rng: np.random.Generator, duration: float, life: Life) -> World:
    """Return a junction with a life of its own, watched from the kerb."""
    crossing, site = make_site(rng, shift=rng.uniform(0.0, 40.0))
    kerb = crossing.arm(0).reversed().beside(-4.6)
    site.add_ego(kerb, crossing.reaches[0] - 22.0, 1.0, initial=0.0, go=np.inf, wander=0.0)
    populate(site, crossing, duration, life)
    furnish(site, crossing, life)
    return site.finish(duration)


GROUPS = {4: 0.15, 3: 0.2, 2: 0.35, 1: 0.3}
LARGE_GROUPS = {5: 0.15, 3: 0.25, 2: 0.35, 1: 0.25}
"""Shares of people on foot by how many go together."""
WAITS = 39.0
"""Seconds by which the lights are ahead: the ego stands in the queue for about ten, then drives on."""


def lights(rng: np.random.Generator, duration: float) -> World:
    """Return a junction with long vehicles and queues, which the ego waits at and crosses."""
    return cross(rng, duration, 2, WAITS, Life(heavy=0.3, arrive=40.0, leave=45.0, vans=0.15, parties=GROUPS))


def kerbside(rng: np.random.Generator, duration: float) -> World:
    """Return a street where cars leave and park all the time, between vans that hide them and the people behind."""
    return street(rng, duration, Life(heavy=0.1, arrive=60.0, leave=30.0, vans=0.4, parties=GROUPS))


def outing(rng: np.random.Generator, duration: float) -> World:
    """Return a junction watched from the kerb, with groups of people on all pavements."""
    return watch(rng, duration, Life(heavy=0.2, arrive=35.0, leave=40.0, vans=0.3, parties=LARGE_GROUPS))
