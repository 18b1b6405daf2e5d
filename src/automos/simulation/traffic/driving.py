"""Who drives where and how fast: road users on paths that keep their distance, mind signals, turn and brake.

Longitudinal behaviour is the intelligent driver model (Treiber, Hennecke, Helbing, Phys. Rev. E 2000). Whom to follow
is found from geometry alone, not from lanes: anybody whose outline comes near the stretch of path ahead, so merging,
crossing and a pedestrian in front of the bonnet need no special case. An outline is a row of discs. People on foot step
aside for each other and stop for moving vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from automos.simulation.traffic.agents import Agent, Signal
from automos.simulation.traffic.paths import STEP, Path

Array = npt.NDArray[np.float64]

DT = 0.05
"""Seconds between the steps of the traffic."""
MAX_LATERAL = 2.2
"""m/s^2 a driver accepts in a bend."""
BRAKE = 2.0
"""m/s^2 of comfortable braking."""
ACCELERATE = 1.5
"""m/s^2."""
HARD_BRAKE = 6.0
"""m/s^2, all a vehicle can do."""
REACTION = 0.4
"""Seconds in which a driver who is too fast for a bend slows down to it."""
STANDSTILL_GAP = 1.5
"""Metres kept to whoever stands ahead."""
SIDE_GAP = 0.25
"""Metres between two outlines from which on they are in each other's way."""
TOUCH = 0.15
"""Metres by which outlines may overlap, being rows of discs, before they count as touching."""
CHECK_EVERY = 4
"""Steps between two looks for touching outlines."""
ASIDE = (0.8, 1.2)
"""m/s at which people step aside, and metres they do so at most."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What the agents did, every DT seconds.

    Attributes
    ----------
    s : (T, A) metres along each agent's path.
    v : (T, A) m/s.
    side : (T, A) metres to the left of the path.
    present : (T, A) bool.
    """

    s: Array
    v: Array
    side: Array
    present: npt.NDArray[np.bool_]


class _Lines(NamedTuple):
    """All paths, one after the other: `starts` (P + 1,) tells where each begins; `limit` is the speed bends allow."""

    xy: Array
    heading: Array
    starts: npt.NDArray[np.int64]
    limit: Array


class _Crew(NamedTuple):
    """The agents' constant attributes, (A,) each; see `Agent`."""

    path: npt.NDArray[np.int64]
    start: Array
    speed: Array
    initial: Array
    enter: Array
    go: Array
    stop: Array
    offset: Array
    front: Array
    rear: Array
    width: Array
    headway: Array
    on_foot: npt.NDArray[np.bool_]


_CREW_TYPES = {"path": np.int64, "on_foot": np.bool_}


class _Now(NamedTuple):
    """One row of a `Drive`, and where in the plane that puts the agents."""

    s: Array
    v: Array
    side: Array
    present: npt.NDArray[np.bool_]
    x: Array
    y: Array


def drive(agents: list[Agent], signals: list[Signal], duration: float) -> Drive:
    """Return the motion of all `agents` over `duration` seconds. Cost: steps x agents x neighbours."""
    lines, crew = _tables(agents)
    row = {id(agent.path): int(p) for agent, p in zip(agents, crew.path, strict=True)}
    lights = np.array([(row[id(g.path)], g.at, g.period, g.green, g.shift) for g in signals if id(g.path) in row])
    n_steps = int(np.ceil(duration / DT)) + 2
    shape = (n_steps, len(agents))
    record = Drive(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape, np.bool_))
    _drive(lines, crew, lights.reshape(-1, 5).astype(np.float64), record.s, record.v, record.side, record.present)
    return record


def _tables(agents: list[Agent]) -> tuple[_Lines, _Crew]:
    paths = list({id(agent.path): agent.path for agent in agents}.values())
    row = {id(path): k for k, path in enumerate(paths)}
    lines = _Lines(
        np.concatenate([path.xy for path in paths]),
        np.concatenate([path.heading for path in paths]),
        np.cumsum([0] + [len(path.xy) for path in paths]),
        np.concatenate([_bend_speed(path) for path in paths]),
    )
    columns = {name: np.array([getattr(a, name) for a in agents]) for name in _Crew._fields}
    columns["path"] = np.array([row[id(a.path)] for a in agents])
    columns["initial"] = np.array([a.speed if a.initial is None else a.initial for a in agents])
    crew = _Crew(**{name: values.astype(_CREW_TYPES.get(name, np.float64)) for name, values in columns.items()})
    return lines, crew


def _bend_speed(path: Path) -> Array:
    """Return (K,) m/s, the most one may go at each sample so that every bend ahead is met slowly enough."""
    smooth = np.convolve(np.abs(path.curvature), np.ones(7) / 7.0, mode="same")
    limit = np.sqrt(MAX_LATERAL / np.maximum(smooth, 1e-4))
    for k in range(len(limit) - 2, -1, -1):
        limit[k] = min(limit[k], np.sqrt(limit[k + 1] ** 2 + 2.0 * 0.7 * BRAKE * STEP))
    return limit


def drive_unharmed(agents: list[Agent], signals: list[Signal], duration: float) -> tuple[list[Agent], Drive]:
    """Return the agents that get through `duration` seconds without touching each other, and their motion.

    Of two that would touch, the later in the list was never there; the first agent always stays.
    """
    while True:
        record = drive(agents, signals, duration)
        lines, crew = _tables(agents)
        harmed = np.zeros(len(agents), np.bool_)
        for t in range(0, len(record.s), CHECK_EVERY):
            now = _Now(record.s[t], record.v[t], record.side[t], record.present[t], *np.empty((2, len(agents))))
            _mark_touching(lines, crew, now, harmed)
        if not harmed.any():
            return agents, record
        agents = [agent for agent, is_harmed in zip(agents, harmed, strict=True) if not is_harmed]


@numba.njit(cache=True, nogil=True)
def _mark_touching(lines, crew, now, harmed):  # type: ignore[no-untyped-def]
    """Set `harmed` for the later of any two outlines that overlap, unless both are on foot."""
    for a in range(len(now.s)):
        now.x[a], now.y[a], _ = _place(lines, crew.path[a], now.s[a], now.side[a])
    for b in range(1, len(now.s)):
        for a in range(b):
            if (
                not (now.present[a] and now.present[b])
                or (crew.on_foot[a] and crew.on_foot[b])
                or harmed[a]
                or harmed[b]
            ):
                continue
            reach = crew.front[a] + crew.rear[a] + crew.front[b] + crew.rear[b]
            if np.hypot(now.x[a] - now.x[b], now.y[a] - now.y[b]) > reach:
                continue
            least = 0.5 * (crew.width[a] + crew.width[b]) - TOUCH
            for i in range(_n_discs(a, crew)):
                ax, ay, _ = _disc(a, i, lines, crew, now)
                for j in range(_n_discs(b, crew)):
                    bx, by, _ = _disc(b, j, lines, crew, now)
                    if np.hypot(ax - bx, ay - by) < least:
                        harmed[b] = True


@numba.njit(cache=True, nogil=True)
def _drive(lines, crew, lights, s, v, side, present):  # type: ignore[no-untyped-def]
    n_steps, n_agents = s.shape
    follows = np.full(n_agents, -1)
    has_left = np.zeros(n_agents, np.bool_)
    for a in range(n_agents):
        s[0, a], side[0, a] = crew.start[a], crew.offset[a]
        v[0, a] = crew.initial[a] if crew.go[a] <= 0.0 else 0.0
        present[0, a] = crew.enter[a] <= 0.0
    for t in range(1, n_steps):
        time = t * DT
        now = _Now(s[t - 1], v[t - 1], side[t - 1], present[t - 1], np.empty(n_agents), np.empty(n_agents))
        for a in range(n_agents):
            now.x[a], now.y[a], _ = _place(lines, crew.path[a], now.s[a], now.side[a])
        s[t], v[t], side[t], present[t] = now.s, now.v, now.side, now.present
        for a in range(n_agents):
            if not now.present[a]:
                if not has_left[a] and time >= crew.enter[a]:
                    gap, _, _ = _gap_ahead(a, lines, crew, now, -crew.rear[a], 8.0 + 1.5 * now.v[a], follows)
                    present[t, a] = gap == np.inf  # enters once its place and the road before it are free
                continue
            waits = now.v[a] == 0.0 and crew.go[a] > 0.0 and now.s[a] == crew.start[a]
            if waits and (time < crew.go[a] or _is_somebody_coming(a, lines, crew, now)):
                continue
            v[t, a], side[t, a] = _advance(a, time, lines, crew, lights, now, follows)
            s[t, a] = now.s[a] + 0.5 * DT * (now.v[a] + v[t, a])
            p = crew.path[a]
            if s[t, a] > (lines.starts[p + 1] - lines.starts[p] - 1) * STEP - crew.front[a] - 2.0:
                present[t, a] = False
                has_left[a] = True


@numba.njit(cache=True, nogil=True)
def _advance(a, time, lines, crew, lights, now, follows):  # type: ignore[no-untyped-def]
    """Return agent a's new speed and its new distance from the line of its path."""
    p, speed = crew.path[a], now.v[a]
    k = min(max(int(now.s[a] / STEP), 0), lines.starts[p + 1] - lines.starts[p] - 1)
    wish = max(min(crew.speed[a], lines.limit[lines.starts[p] + k]), 0.5)
    gap, lead, side = np.inf, 0.0, now.side[a]
    if crew.on_foot[a]:
        push, is_blocked = _sidestep(a, lines, crew, now)
        side += DT * (push * ASIDE[0] - 0.3 * (side - crew.offset[a]))
        side = min(max(side, crew.offset[a] - ASIDE[1]), crew.offset[a] + ASIDE[1])
        if is_blocked:
            return max(speed - DT * HARD_BRAKE, 0.0), side
    else:
        horizon = 12.0 + 1.5 * speed + speed**2 / (2.0 * BRAKE)
        gap, lead, follows[a] = _gap_ahead(a, lines, crew, now, crew.front[a], horizon, follows)
    halt = min(_red_ahead(a, time, crew, lights, now) + 1.0, crew.stop[a] - now.s[a] + STANDSTILL_GAP)
    if halt < gap:
        gap, lead = halt, 0.0
    desired = STANDSTILL_GAP + speed * crew.headway[a] + speed * (speed - lead) / (2.0 * np.sqrt(ACCELERATE * BRAKE))
    pull = 1.0 - (speed / wish) ** 4 - (max(desired, 0.0) / max(gap, 0.1)) ** 2
    pull = min(pull, (wish - speed) / (ACCELERATE * REACTION)) if speed > wish else pull
    new = max(speed + DT * min(max(ACCELERATE * pull, -HARD_BRAKE), 1.8), 0.0)
    return (0.0 if new < 0.02 and pull < 0.05 else new), side


@numba.njit(cache=True, nogil=True)
def _place(lines, p, s, offset):  # type: ignore[no-untyped-def]
    """Return x, y and heading at `s` on path `p`, `offset` to its left."""
    last = lines.starts[p + 1] - lines.starts[p] - 1
    k = min(max(s / STEP, 0.0), last - 1e-6)
    i = int(k)
    f = k - i
    j = lines.starts[p] + i
    x = lines.xy[j, 0] * (1 - f) + lines.xy[j + 1, 0] * f
    y = lines.xy[j, 1] * (1 - f) + lines.xy[j + 1, 1] * f
    h = lines.heading[j]
    return x - offset * np.sin(h), y + offset * np.cos(h), h


@numba.njit(cache=True, nogil=True)
def _n_discs(b, crew):  # type: ignore[no-untyped-def]
    return max(1, int((crew.front[b] + crew.rear[b]) / 1.5))


@numba.njit(cache=True, nogil=True)
def _disc(b, d, lines, crew, now):  # type: ignore[no-untyped-def]
    """Return x, y and heading of disc `d` of agent b's outline; its radius is half the agent's width."""
    n, half = _n_discs(b, crew), 0.5 * crew.width[b]
    length = crew.front[b] + crew.rear[b]
    back = crew.rear[b] - half - (d + 0.5) / n * (length - 2 * half) if n > 1 else 0.0
    return _place(lines, crew.path[b], now.s[b] - back, now.side[b])


@numba.njit(cache=True, nogil=True)
def _gap_ahead(a, lines, crew, now, from_, horizon, follows):  # type: ignore[no-untyped-def]
    """Return metres to the nearest outline on a's path ahead of its origin + `from_`, its speed along it, and whose."""
    p, side = crew.path[a], now.side[a]
    begin = now.s[a] + from_
    x0, y0, _ = _place(lines, p, begin, side)
    first = max(int(begin / STEP), 0)
    last = min(first + int((horizon + crew.front[a] - from_) / STEP), lines.starts[p + 1] - lines.starts[p] - 1)
    best, speed, who = np.inf, 0.0, -1
    for b in range(len(now.s)):
        if b == a or not now.present[b] or (follows[b] == a and a < b):
            continue
        if np.hypot(now.x[b] - x0, now.y[b] - y0) > horizon + crew.front[b] + crew.rear[b] + crew.rear[a]:
            continue
        reach = 0.5 * (crew.width[a] + crew.width[b]) + SIDE_GAP
        for d in range(_n_discs(b, crew)):
            dx, dy, dh = _disc(b, d, lines, crew, now)
            k = first
            while k < last and (k - first) * STEP < best:
                j = lines.starts[p] + k
                h = lines.heading[j]
                apart = np.hypot(lines.xy[j, 0] - side * np.sin(h) - dx, lines.xy[j, 1] + side * np.cos(h) - dy)
                if apart < reach:
                    best, who = (k - first) * STEP, b
                    speed = max(now.v[b] * np.cos(dh - h), 0.0)
                    break
                k += max(1, int((apart - reach) / STEP))  # nothing can be nearer along the path
    return best, speed, who


@numba.njit(cache=True, nogil=True)
def _red_ahead(a, time, crew, lights, now):  # type: ignore[no-untyped-def]
    """Return metres from a's front to the nearest red light it can still stop at."""
    nose, nearest = now.s[a] + crew.front[a], np.inf
    for g in range(len(lights)):
        if int(lights[g, 0]) != crew.path[a]:
            continue
        is_red = (time + lights[g, 4]) % lights[g, 2] >= lights[g, 3]
        ahead = lights[g, 1] - nose
        if is_red and ahead > -0.5 and now.v[a] ** 2 / (2.0 * max(ahead, 0.1)) < 4.5:
            nearest = min(nearest, ahead)
    return nearest


@numba.njit(cache=True, nogil=True)
def _is_somebody_coming(a, lines, crew, now):  # type: ignore[no-untyped-def]
    """Whether a vehicle comes from behind or beside, so that a must not pull out."""
    x, y, h = _place(lines, crew.path[a], now.s[a], now.side[a])
    for b in range(len(now.s)):
        if b == a or not now.present[b] or crew.on_foot[b] or now.v[b] < 1.0:
            continue
        _, _, bh = _place(lines, crew.path[b], now.s[b], now.side[b])
        dx, dy = now.x[b] - x, now.y[b] - y
        ahead, beside = dx * np.cos(h) + dy * np.sin(h), abs(dy * np.cos(h) - dx * np.sin(h))
        is_near = -3.0 * now.v[b] - 8.0 < ahead < 8.0 + crew.rear[b]
        if np.cos(bh - h) > 0.5 and beside < 5.0 and is_near:
            return True
    return False


@numba.njit(cache=True, nogil=True)
def _sidestep(a, lines, crew, now):  # type: ignore[no-untyped-def]
    """Return to which side (-1 to 1, positive is left) a walker steps, and whether somebody stands in its way."""
    x, y, h = _place(lines, crew.path[a], now.s[a], now.side[a])
    push, is_blocked = 0.0, False
    for b in range(len(now.s)):
        if b == a or not now.present[b]:
            continue
        if np.hypot(now.x[b] - x, now.y[b] - y) > 4.0 + crew.front[b] + crew.rear[b]:
            continue
        half = 0.5 * crew.width[b]
        room = half + 0.5 * crew.width[a] + 0.2
        is_fast = not crew.on_foot[b] and now.v[b] > 0.5
        for d in range(_n_discs(b, crew)):
            dx, dy, _ = _disc(b, d, lines, crew, now)
            ahead = (dx - x) * np.cos(h) + (dy - y) * np.sin(h)
            left = (dy - y) * np.cos(h) - (dx - x) * np.sin(h)
            if -0.2 < ahead < half + 2.2 and abs(left) < room:
                push += -1.0 if left >= 0.0 else 1.0
                is_blocked |= ahead > 0.0 and ahead < room + (1.2 if is_fast else 0.1)
    return min(max(push, -1.0), 1.0), is_blocked
