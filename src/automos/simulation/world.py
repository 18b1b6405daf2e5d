"""A world: what stands still, what moves, and the ego vehicle among it. And the site on which scenarios build one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.simulation.shapes.mesh import Mesh, join
from automos.simulation.shapes.things import Thing
from automos.simulation.shapes.vehicles import make_car
from automos.simulation.terrain import Road, Terrain, make_hills
from automos.simulation.traffic.agents import Agent, Signal
from automos.simulation.traffic.driving import drive_unharmed
from automos.simulation.traffic.motion import EgoMotion, Motion, follow, ride, transforms
from automos.simulation.traffic.paths import Path


@dataclass(frozen=True, eq=False)
class Sway:
    """Foliage in the wind: a mesh that rocks about its foot. Static by definition: it does not go anywhere."""

    mesh: Mesh
    foot: tuple[float, float, float]
    amplitude: float
    period: float
    phase: float

    @cached_property
    def center(self) -> Array:
        """(3,) middle of its box, body frame."""
        return self.mesh.bounds.mean(axis=0)

    @cached_property
    def radius(self) -> float:
        """Metres, of the sphere about `center` that holds it."""
        low, high = self.mesh.bounds
        return float(0.5 * np.linalg.norm(high - low))

    def state(self, time: float) -> Array:
        """Return the (6,) state at `time` seconds; two periods that do not divide each other keep it from repeating."""
        w = 2.0 * np.pi / self.period
        pitch = self.amplitude * np.sin(w * time + self.phase)
        roll = 0.6 * self.amplitude * np.sin(1.37 * w * time + 2.1 * self.phase)
        return np.array([*self.foot, 0.0, pitch, roll])


@dataclass(frozen=True, eq=False)
class World:
    """Everything there is, in the site frame (z up, metres).

    Attributes
    ----------
    static : scenery and standing objects.
    static_object : (F,) int32, for each face of `static` the id of the object it belongs to, 0 for scenery.
    parked : standing objects, with ids 1..P.
    parked_state : (P, 6).
    movers : M bodies that follow `motion`, with ids P+1..P+M.
    motion : their poses.
    swaying : foliage in the wind.
    ego : motion of the ego vehicle's body.
    ground_under_ego : metres, height of the ground where the ego starts.
    """

    static: Mesh
    static_object: npt.NDArray[np.int32]
    parked: tuple[Thing, ...]
    parked_state: Array
    movers: tuple[Thing, ...]
    motion: Motion
    swaying: tuple[Sway, ...]
    ego: EgoMotion
    ground_under_ego: float

    @property
    def objects(self) -> tuple[Thing, ...]:
        """All objects; the one with id k is at place k - 1."""
        return self.parked + self.movers

    def object_states(self, time: float) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return ((K, 6) states of all objects, (K,) present) at `time` seconds."""
        state, _, present = self.motion.at(time)
        return np.concatenate([self.parked_state, state]), np.concatenate([np.ones(len(self.parked), bool), present])


class Site:
    """Where a scenario puts things up, piece by piece; `finish` sets it in motion."""

    def __init__(self, terrain: Terrain, rng: np.random.Generator):
        self.terrain = terrain
        self.rng = rng
        self.agents: list[Agent] = []
        self.signals: list[Signal] = []
        self._scenery: list[Mesh] = []
        self._parked: list[tuple[Thing, Array]] = []
        self._swaying: list[Sway] = []
        self._reserved: list[tuple[float, float]] = []

    @classmethod
    def over_hills(
        cls, rng: np.random.Generator, waves: Sequence[tuple[float, float]], roads: tuple[Road, ...], **ground: Any
    ) -> Site:
        """Return an empty site with `roads` over hills of `waves` (`make_hills`); `ground` is for its `Terrain`."""
        return cls(Terrain(roads, make_hills(rng, waves), seed=int(rng.integers(1 << 30)), **ground), rng)

    def add_ego(self, path: Path, start: float, speed: float, **how: Any) -> None:
        """Put the car that carries the sensor on a path, before anyone else; `how` is for its `Agent`."""
        self.agents.append(Agent((make_car(self.rng, "estate"),), path, start, speed, **how))

    def height(self, x: float, y: float) -> float:
        """Return the ground's height at a place, metres."""
        return float(self.terrain.height(np.array([[x, y]]))[0])

    def add(self, mesh: Mesh, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, z: float | None = None) -> None:
        """Put scenery on the ground (or at height `z`) at a place."""
        self._scenery.append(mesh.moved(x, y, self.height(x, y) if z is None else z, yaw))

    def sway(self, mesh: Mesh, x: float, y: float, amplitude: float) -> None:
        """Put foliage on the ground that rocks in the wind by `amplitude` radians."""
        foot = (x, y, self.height(x, y))
        period, phase = self.rng.uniform(1.5, 4.0), self.rng.uniform(0, 2 * np.pi)
        self._swaying.append(Sway(mesh, foot, amplitude, period, phase))

    def park(self, thing: Thing, x: float, y: float, yaw: float) -> None:
        """Put an object on the ground that never moves."""
        rear, front = thing.axles
        along = np.array([np.cos(yaw), np.sin(yaw)])
        z_rear, z_front = self.terrain.height(np.array([(x, y) + rear * along, (x, y) + front * along]))
        pitch = -np.arctan2(z_front - z_rear, front - rear) if front - rear > 0.5 else 0.0
        z = z_rear - rear / (front - rear) * (z_front - z_rear)
        self._parked.append((thing, np.array([x, y, z, yaw, pitch, 0.0])))

    def reserve(self, x: float, y: float) -> None:
        """Keep a place free for somebody who will stop there."""
        self._reserved.append((float(x), float(y)))

    def is_free(self, x: float, y: float, radius: float) -> bool:
        """Whether nothing stands, waits to start or is to stop within `radius` metres of a place."""
        if any(np.hypot(a - x, b - y) < radius + 2.5 for a, b in self._reserved) or any(
            np.hypot(s[0] - x, s[1] - y) < radius for _, s in self._parked
        ):
            return False
        waiting = (a.outline for a in self.agents if a.enter <= 0.0)
        return all(np.hypot(*(outline - (x, y)).T).min() > radius for outline in waiting)

    def finish(self, duration: float, reach: float = 140.0, unevenness: float = 1.0) -> World:
        """Return the world after driving all agents for `duration` seconds; the first agent carries the sensor.

        The ground reaches `reach` metres beyond the roads; `unevenness` is that of the road under the ego.
        """
        agents, record = drive_unharmed(self.agents, self.signals, duration)
        motion = follow(agents, record, self.terrain, self.rng)
        ego_motion = ride(motion.state[:, 0], record.v[:, 0], self.rng, unevenness)
        others = np.arange(1, motion.state.shape[1])
        movers = [part for agent in agents for part in agent.parts]
        ground = self.terrain.mesh(reach)
        states = np.array([s for _, s in self._parked]).reshape(-1, 6)
        standing = [
            thing.frames[0].transformed(T) for (thing, _), T in zip(self._parked, transforms(states), strict=True)
        ]
        pieces = [ground, *self._scenery, *standing]
        owner = [0] * (1 + len(self._scenery)) + list(range(1, len(standing) + 1))
        start = ego_motion.at(0.0)[:3, 3]
        return World(
            static=join(pieces),
            static_object=np.repeat(np.array(owner, np.int32), [len(p) for p in pieces]),
            parked=tuple(thing for thing, _ in self._parked),
            parked_state=states,
            movers=tuple(movers[k] for k in others),
            motion=Motion(motion.state[:, others], motion.travelled[:, others], motion.present[:, others]),
            swaying=tuple(self._swaying),
            ego=ego_motion,
            ground_under_ego=float(self.terrain.height(start[None, :2])[0]),
        )


def is_clear(agents: list[Agent], newcomer: Agent, clearance: float = 1.0) -> bool:
    """Whether `newcomer` starts clear of all `agents`: no two outlines within `clearance` metres."""
    a = newcomer.outline
    for b in agents:
        if b.enter > 0.0 or np.hypot(*(a[0] - b.outline[0])) > 40.0:
            continue
        apart = np.linalg.norm(a[:, None] - b.outline[None], axis=2).min()
        if apart < 0.5 * (newcomer.width + b.width) + clearance:
            return False
    return True
