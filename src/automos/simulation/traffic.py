"""Who drives where and how fast: road users on paths that keep their distance, mind signals, turn and brake.

Longitudinal behaviour is the intelligent driver model (Treiber, Hennecke, Helbing, Phys. Rev. E 2000). Whom to follow is
found from geometry alone, not from lanes: anybody whose outline comes near the stretch of path ahead, so merging,
crossing and a pedestrian in front of the bonnet need no special case.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
import numpy.typing as npt

from automos.simulation.paths import STEP, Path
from automos.simulation.things import Thing

Array = npt.NDArray[np.float64]

DT = 0.05
"""Seconds between the steps of the traffic."""
MAX_LATERAL = 2.2
"""m/s^2 a driver accepts in a bend."""
BRAKE = 2.0
"""m/s^2 of comfortable braking."""


@dataclass(frozen=True, eq=False)
class Agent:
    """A road user: one or more coupled things on a path.

    Attributes
    ----------
    parts : things from the front backward.
    path : the path it follows.
    start : metres along the path of the first part's origin when it enters.
    speed : m/s it would like to go.
    initial : m/s when it enters; the desired speed where None.
    enter : seconds after which it exists.
    go : seconds until which it waits where it is.
    stop : metres along the path where it stops for good.
    offset : metres to the left of the path.
    wander : metres it strays to both sides.
    gaps : metres behind the first part's origin of each part's origin.
    headway : seconds to whom it follows.
    pushy : goes without looking (people on pavements).
    """

    parts: tuple[Thing, ...]
    path: Path
    start: float
    speed: float
    initial: float | None = None
    enter: float = 0.0
    go: float = 0.0
    stop: float = np.inf
    offset: float = 0.0
    wander: float = 0.15
    gaps: tuple[float, ...] = (0.0,)
    headway: float = 1.3
    pushy: bool = False

    @cached_property
    def front(self) -> float:
        """Metres from the origin to the front bumper."""
        return float(self.parts[0].bounds[1, 0])

    @cached_property
    def rear(self) -> float:
        """Metres from the origin back to the rear bumper of the last part."""
        return float(self.gaps[-1] - self.parts[-1].bounds[0, 0])

    @cached_property
    def width(self) -> float:
        """Metres."""
        return float(max(part.size[1] for part in self.parts))

    @cached_property
    def outline(self) -> Array:
        """(K, 2) points along its middle line where it starts, about a metre apart."""
        margin = 0.5 * self.width
        ends = self.start - self.rear + margin, self.start + self.front - margin
        return self.path.at(np.linspace(*ends, 1 + int(self.front + self.rear)), self.offset)[0]


@dataclass(frozen=True)
class Signal:
    """A stop line at `at` metres along `path`, green while (time + shift) modulo `period` is below `green` seconds."""

    path: Path
    at: float
    period: float
    green: float
    shift: float = 0.0


@dataclass(frozen=True, eq=False)
class Drive:
    """What the agents did, every DT seconds.

    Attributes
    ----------
    s : (T, A) metres along each agent's path.
    v : (T, A) m/s.
    present : (T, A) bool.
    """

    s: Array
    v: Array
    present: npt.NDArray[np.bool_]


def drive(agents: list[Agent], signals: list[Signal], duration: float) -> Drive:
    """Return the motion of all `agents` over `duration` seconds. Cost: steps x agents x neighbours."""
    paths = list({id(agent.path): agent.path for agent in agents}.values())
    row = {id(path): k for k, path in enumerate(paths)}
    starts = np.cumsum([0] + [len(path.xy) for path in paths])
    line = np.concatenate([path.xy for path in paths])
    heading = np.concatenate([path.heading for path in paths])
    limit = np.concatenate([_bend_speed(path) for path in paths])
    table = np.array(
        [
            (
                row[id(a.path)],
                a.start,
                a.speed,
                a.speed if a.initial is None else a.initial,
                a.enter,
                a.go,
                a.stop,
                a.offset,
                a.front,
                a.rear,
                a.width,
                a.headway,
                a.pushy,
            )
            for a in agents
        ],
        np.float64,
    )
    lights = np.array(
        [(row[id(g.path)], g.at, g.period, g.green, g.shift) for g in signals if id(g.path) in row], np.float64
    ).reshape(-1, 5)
    n_steps = int(np.ceil(duration / DT)) + 2
    s, v = np.zeros((n_steps, len(agents))), np.zeros((n_steps, len(agents)))
    present = np.zeros((n_steps, len(agents)), np.bool_)
    _drive(line, heading, starts, limit, table, lights, s, v, present)
    return Drive(s, v, present)


def _bend_speed(path: Path) -> Array:
    """Return (K,) m/s, the most one may go at each sample so that every bend ahead is met slowly enough."""
    smooth = np.convolve(np.abs(path.curvature), np.ones(7) / 7.0, mode="same")
    limit = np.sqrt(MAX_LATERAL / np.maximum(smooth, 1e-4))
    for k in range(len(limit) - 2, -1, -1):
        limit[k] = min(limit[k], np.sqrt(limit[k + 1] ** 2 + 2.0 * 0.7 * BRAKE * STEP))
    return limit


@numba.njit(cache=True, nogil=True)
def _place(line, heading, starts, p, s, offset):  # type: ignore[no-untyped-def]
    last = starts[p + 1] - starts[p] - 1
    k = min(max(s / STEP, 0.0), last - 1e-6)
    i = int(k)
    f = k - i
    j = starts[p] + i
    x = line[j, 0] * (1 - f) + line[j + 1, 0] * f
    y = line[j, 1] * (1 - f) + line[j + 1, 1] * f
    h = heading[j]
    return x - offset * np.sin(h), y + offset * np.cos(h), h


@numba.njit(cache=True, nogil=True)
def _gap_ahead(a, agents, line, heading, starts, s, v, present, horizon, follows):  # type: ignore[no-untyped-def]
    """Metres from a's bumper to the nearest outline on its path ahead, that one's speed along a's path, and who."""
    p = int(agents[a, 0])
    offset, width = agents[a, 7], agents[a, 10]
    nose = s[a] + agents[a, 8]
    ax, ay, ah = _place(line, heading, starts, p, nose, offset)
    first = max(int(nose / STEP), 0)
    last = min(first + int(horizon / STEP), starts[p + 1] - starts[p] - 1)
    best, speed, who = np.inf, 0.0, -1
    for b in range(len(agents)):
        if b == a or not present[b] or (follows[b] == a and a < b):
            continue
        q = int(agents[b, 0])
        bx, by, bh = _place(line, heading, starts, q, s[b], agents[b, 7])
        length = agents[b, 8] + agents[b, 9]
        if (bx - ax) ** 2 + (by - ay) ** 2 > (horizon + length) ** 2:
            continue
        half = 0.5 * agents[b, 10]
        reach = 0.5 * width + half + 0.25
        n_discs = max(1, int(length / 1.5))
        for d in range(n_discs):
            back = agents[b, 9] - half - (d + 0.5) / n_discs * (length - 2 * half) if n_discs > 1 else 0.0
            dx, dy, dh = _place(line, heading, starts, q, s[b] - back, agents[b, 7])
            k = first
            while k < last and (k - first) * STEP < best:
                j = starts[p] + k
                x = line[j, 0] - offset * np.sin(heading[j])
                y = line[j, 1] + offset * np.cos(heading[j])
                apart = np.hypot(x - dx, y - dy)
                if apart < reach:
                    best, who = (k - first) * STEP, b
                    speed = max(v[b] * np.cos(dh - heading[j]), 0.0)
                    break
                k += max(1, int((apart - reach) / STEP))  # nothing can be nearer along the path
    return best, speed, who


@numba.njit(cache=True, nogil=True)
def _drive(line, heading, starts, limit, agents, lights, s, v, present):  # type: ignore[no-untyped-def]
    n_steps, n_agents = s.shape
    follows = np.full(n_agents, -1)
    left = np.zeros(n_agents, np.bool_)
    for a in range(n_agents):
        s[0, a], v[0, a] = agents[a, 1], agents[a, 3] if agents[a, 5] <= 0.0 else 0.0
        present[0, a] = agents[a, 4] <= 0.0
    for t in range(1, n_steps):
        now = t * DT
        for a in range(n_agents):
            s[t, a], v[t, a] = s[t - 1, a], v[t - 1, a]
            present[t, a] = present[t - 1, a]
            p = int(agents[a, 0])
            if not present[t, a]:
                if left[a] or now < agents[a, 4]:
                    continue
                horizon = 8.0 + 1.5 * v[t, a]
                gap, _, _ = _gap_ahead(
                    a, agents, line, heading, starts, s[t - 1], v[t - 1], present[t - 1], horizon, follows
                )
                present[t, a] = gap == np.inf  # enters once the road before it is free
                continue
            if now < agents[a, 5]:
                v[t, a] = 0.0
                continue
            speed = v[t - 1, a]
            k = min(max(int(s[t - 1, a] / STEP), 0), starts[p + 1] - starts[p] - 1)
            wish = max(min(agents[a, 2], limit[starts[p] + k]), 0.5)
            horizon = 12.0 + 1.5 * speed + speed**2 / (2.0 * BRAKE)
            gap, lead, who = np.inf, 0.0, -1
            if agents[a, 12] == 0.0:
                gap, lead, who = _gap_ahead(
                    a, agents, line, heading, starts, s[t - 1], v[t - 1], present[t - 1], horizon, follows
                )
            follows[a] = who
            nose = s[t - 1, a] + agents[a, 8]
            for g in range(len(lights)):
                if int(lights[g, 0]) != p:
                    continue
                is_red = (now + lights[g, 4]) % lights[g, 2] >= lights[g, 3]
                ahead = lights[g, 1] - nose
                if is_red and ahead > -0.5 and ahead + 1.0 < gap and speed**2 / (2.0 * max(ahead, 0.1)) < 4.5:
                    gap, lead = ahead + 1.0, 0.0
            ahead = agents[a, 6] - s[t - 1, a]
            if ahead + 1.5 < gap:
                gap, lead = ahead + 1.5, 0.0
            desired = 1.5 + speed * agents[a, 11] + speed * (speed - lead) / (2.0 * np.sqrt(1.5 * BRAKE))
            pull = 1.0 - (speed / wish) ** 4 - (max(desired, 0.0) / max(gap, 0.1)) ** 2
            new = max(speed + DT * min(max(1.5 * pull, -6.0), 1.8), 0.0)
            if new < 0.02 and pull < 0.05:
                new = 0.0
            v[t, a] = new
            s[t, a] = s[t - 1, a] + 0.5 * DT * (speed + new)
            if s[t, a] > (starts[p + 1] - starts[p] - 1) * STEP - agents[a, 8] - 2.0:
                present[t, a] = False
                left[a] = True
