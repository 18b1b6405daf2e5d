"""Who drives where and how fast: road users on paths that keep their distance, mind signals, turn and brake.

Longitudinal behaviour is the intelligent driver model (Treiber, Hennecke, Helbing, Phys. Rev. E 2000). Whom to follow
is found from geometry alone, not from lanes: anyone whose outline comes near the path ahead, so merging,
crossing and a pedestrian in front of the bonnet need no special case. An outline is a row of discs. People on foot step
aside for each other and stop for moving vehicles.
"""

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.simulation.traffic.agents import Agent, Signal
from automos.simulation.traffic.paths import STEP, Path
from automos.simulation.traffic.sight import disc, gap_ahead, is_somebody_coming, n_discs, place, red_ahead, sidestep

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


# Tables are arrays of records: numba takes several times as long to compile the same with a tuple of columns.
_LINES = np.dtype([("x", float), ("y", float), ("heading", float), ("limit", float)])
"""Samples of all paths, one path after the other; `limit` is the speed that bends allow."""
_CREW = np.dtype(
    [("path", np.int64), ("on_foot", np.bool_)]
    + [(name, float) for name in ("start", "speed", "initial", "enter", "go", "stop", "offset")]
    + [(name, float) for name in ("front", "rear", "width", "headway")]
)
"""What stays as it is of each agent; see `Agent`. `path` counts paths."""
_STATE = np.dtype([(name, float) for name in ("s", "v", "side", "x", "y")] + [("present", np.bool_)])
"""An agent at a step: metres along its path, m/s, metres to its left, where that is, and whether it is there."""


def drive(agents: list[Agent], signals: list[Signal], duration: float) -> np.recarray:
    """Return the motion of all `agents` over `duration` seconds. Cost: steps x agents x neighbours.

    Returns
    -------
    (T, A) records of `_STATE`
        Every DT seconds.
    """
    return _drive_all(agents, signals, duration)[1].view(np.recarray)


def _drive_all(
    agents: list[Agent], signals: list[Signal], duration: float
) -> tuple[tuple[npt.NDArray, ...], npt.NDArray]:
    """Return (_LINES, where each path begins in them, _CREW) and (T, A) _STATE."""
    rows = {path: k for k, path in enumerate(dict.fromkeys(agent.path for agent in agents))}
    lines = np.empty(sum(len(path.xy) for path in rows), _LINES)
    lines["x"], lines["y"] = np.concatenate([path.xy for path in rows]).T
    lines["heading"] = np.concatenate([path.heading for path in rows])
    lines["limit"] = np.concatenate([_bend_speed(path) for path in rows])
    crew = np.empty(len(agents), _CREW)
    for name in set(_CREW.names or ()) - {"path", "initial"}:
        crew[name] = [getattr(a, name) for a in agents]
    crew["path"] = [rows[a.path] for a in agents]
    crew["initial"] = [a.speed if a.initial is None else a.initial for a in agents]
    lights = np.array([(rows[g.path], g.at, g.period, g.green, g.shift) for g in signals if g.path in rows])
    tables = lines, np.cumsum([0] + [len(path.xy) for path in rows]), crew
    states = np.zeros((int(np.ceil(duration / DT)) + 2, len(agents)), _STATE)
    _drive(*tables, lights.reshape(-1, 5).astype(np.float64), states)
    return tables, states


def _bend_speed(path: Path) -> Array:
    """Return (K,) m/s, the most one may go at each sample so that every bend ahead is met slowly enough."""
    smooth = np.convolve(np.abs(path.curvature), np.ones(7) / 7.0, mode="same")
    limit = np.sqrt(MAX_LATERAL / np.maximum(smooth, 1e-4))
    for k in range(len(limit) - 2, -1, -1):
        limit[k] = min(limit[k], np.sqrt(limit[k + 1] ** 2 + 2.0 * 0.7 * BRAKE * STEP))
    return limit


def drive_unharmed(agents: list[Agent], signals: list[Signal], duration: float) -> tuple[list[Agent], np.recarray]:
    """Return the agents that get through `duration` seconds without touching each other, and their motion.

    Of two that would touch, the later in the list was never there; the first agent always stays.
    """
    while True:
        tables, states = _drive_all(agents, signals, duration)
        harmed = np.zeros(len(agents), np.bool_)
        _mark_touching(*tables, states[::CHECK_EVERY].copy(), harmed)
        if not harmed.any():
            return agents, states.view(np.recarray)
        agents = [agent for agent, is_harmed in zip(agents, harmed, strict=True) if not is_harmed]


@kernel
def _mark_touching(lines, starts, crew, states, harmed):  # type: ignore[no-untyped-def]
    """Set `harmed` for the later of any two outlines that overlap at a step of `states`, unless both are on foot."""
    for t in range(len(states)):
        now = states[t]
        for a in range(len(crew)):
            now[a].x, now[a].y, _ = place(lines, starts, crew[a].path, now[a].s, now[a].side)
        for b in range(1, len(crew)):
            for a in range(b):
                if not (now[a].present and now[b].present) or (crew[a].on_foot and crew[b].on_foot):
                    continue
                if harmed[a] or harmed[b]:
                    continue
                reach = crew[a].front + crew[a].rear + crew[b].front + crew[b].rear
                if np.hypot(now[a].x - now[b].x, now[a].y - now[b].y) > reach:
                    continue
                least = 0.5 * (crew[a].width + crew[b].width) - TOUCH
                for i in range(n_discs(crew[a])):
                    ax, ay, _ = disc(i, lines, starts, crew[a], now[a])
                    for j in range(n_discs(crew[b])):
                        bx, by, _ = disc(j, lines, starts, crew[b], now[b])
                        if np.hypot(ax - bx, ay - by) < least:
                            harmed[b] = True


@kernel
def _drive(lines, starts, crew, lights, states):  # type: ignore[no-untyped-def]
    n_steps, n_agents = states.shape
    follows = np.full(n_agents, -1)
    has_left = np.zeros(n_agents, np.bool_)
    for a in range(n_agents):
        one, first = crew[a], states[0, a]
        first.s, first.side, first.present = one.start, one.offset, one.enter <= 0.0
        first.v = one.initial if one.go <= 0.0 else 0.0
    for t in range(1, n_steps):
        time = t * DT
        now, then = states[t - 1], states[t]
        for a in range(n_agents):
            was, is_ = now[a], then[a]
            was.x, was.y, _ = place(lines, starts, crew[a].path, was.s, was.side)
            is_.s, is_.v, is_.side, is_.present = was.s, was.v, was.side, was.present
        for a in range(n_agents):
            one, was, is_ = crew[a], now[a], then[a]
            if not was.present:
                if not has_left[a] and time >= one.enter:
                    gap, _, _ = gap_ahead(a, lines, starts, crew, now, -one.rear, 8.0 + 1.5 * was.v, follows)
                    is_.present = gap == np.inf  # enters once its place and the road before it are free
                continue
            waits = was.v == 0.0 and one.go > 0.0 and was.s == one.start
            if waits and (time < one.go or is_somebody_coming(a, lines, starts, crew, now)):
                continue
            is_.v, is_.side = _advance(a, time, lines, starts, crew, lights, now, follows)
            is_.s = was.s + 0.5 * DT * (was.v + is_.v)
            if is_.s > (starts[one.path + 1] - starts[one.path] - 1) * STEP - one.front - 2.0:
                is_.present = False
                has_left[a] = True


@kernel
def _advance(a, time, lines, starts, crew, lights, now, follows):  # type: ignore[no-untyped-def]
    """Return agent a's new speed and its new distance from the line of its path."""
    one, was = crew[a], now[a]
    p, speed = one.path, was.v
    k = min(max(int(was.s / STEP), 0), starts[p + 1] - starts[p] - 1)
    wish = max(min(one.speed, lines[starts[p] + k].limit), 0.5)
    gap, lead, side = np.inf, 0.0, was.side
    if one.on_foot:
        push, is_blocked = sidestep(a, lines, starts, crew, now)
        side += DT * (push * ASIDE[0] - 0.3 * (side - one.offset))
        side = min(max(side, one.offset - ASIDE[1]), one.offset + ASIDE[1])
        if is_blocked:
            return max(speed - DT * HARD_BRAKE, 0.0), side
    else:
        horizon = 12.0 + 1.5 * speed + speed**2 / (2.0 * BRAKE)
        gap, lead, follows[a] = gap_ahead(a, lines, starts, crew, now, one.front, horizon, follows)
    halt = min(red_ahead(time, one, lights, was) + 1.0, one.stop - was.s + STANDSTILL_GAP)
    if halt < gap:
        gap, lead = halt, 0.0
    desired = STANDSTILL_GAP + speed * one.headway + speed * (speed - lead) / (2.0 * np.sqrt(ACCELERATE * BRAKE))
    pull = 1.0 - (speed / wish) ** 4 - (max(desired, 0.0) / max(gap, 0.1)) ** 2
    pull = min(pull, (wish - speed) / (ACCELERATE * REACTION)) if speed > wish else pull
    new = max(speed + DT * min(max(ACCELERATE * pull, -HARD_BRAKE), 1.8), 0.0)
    return (0.0 if new < 0.02 and pull < 0.05 else new), side
