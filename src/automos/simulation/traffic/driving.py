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
from automos.simulation.traffic.sight import disc, gap_ahead, is_somebody_coming, n_discs, place, red_ahead, sidestep

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
        now.x[a], now.y[a], _ = place(lines, crew.path[a], now.s[a], now.side[a])
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
            for i in range(n_discs(a, crew)):
                ax, ay, _ = disc(a, i, lines, crew, now)
                for j in range(n_discs(b, crew)):
                    bx, by, _ = disc(b, j, lines, crew, now)
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
            now.x[a], now.y[a], _ = place(lines, crew.path[a], now.s[a], now.side[a])
            s[t, a], v[t, a], side[t, a], present[t, a] = now.s[a], now.v[a], now.side[a], now.present[a]
        for a in range(n_agents):
            if not now.present[a]:
                if not has_left[a] and time >= crew.enter[a]:
                    gap, _, _ = gap_ahead(a, lines, crew, now, -crew.rear[a], 8.0 + 1.5 * now.v[a], follows)
                    present[t, a] = gap == np.inf  # enters once its place and the road before it are free
                continue
            waits = now.v[a] == 0.0 and crew.go[a] > 0.0 and now.s[a] == crew.start[a]
            if waits and (time < crew.go[a] or is_somebody_coming(a, lines, crew, now)):
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
        push, is_blocked = sidestep(a, lines, crew, now)
        side += DT * (push * ASIDE[0] - 0.3 * (side - crew.offset[a]))
        side = min(max(side, crew.offset[a] - ASIDE[1]), crew.offset[a] + ASIDE[1])
        if is_blocked:
            return max(speed - DT * HARD_BRAKE, 0.0), side
    else:
        horizon = 12.0 + 1.5 * speed + speed**2 / (2.0 * BRAKE)
        gap, lead, follows[a] = gap_ahead(a, lines, crew, now, crew.front[a], horizon, follows)
    halt = min(red_ahead(a, time, crew, lights, now) + 1.0, crew.stop[a] - now.s[a] + STANDSTILL_GAP)
    if halt < gap:
        gap, lead = halt, 0.0
    desired = STANDSTILL_GAP + speed * crew.headway[a] + speed * (speed - lead) / (2.0 * np.sqrt(ACCELERATE * BRAKE))
    pull = 1.0 - (speed / wish) ** 4 - (max(desired, 0.0) / max(gap, 0.1)) ** 2
    pull = min(pull, (wish - speed) / (ACCELERATE * REACTION)) if speed > wish else pull
    new = max(speed + DT * min(max(ACCELERATE * pull, -HARD_BRAKE), 1.8), 0.0)
    return (0.0 if new < 0.02 and pull < 0.05 else new), side
