"""A world: what stands still, what moves, and the ego vehicle among it. And the site on which scenarios build one."""

from collections.abc import Sequence
from dataclasses import dataclass
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
from automos.simulation.traffic.paths import Path, Range


@dataclass(frozen=True, eq=False)
class Sway:
    """Foliage in the wind: it rocks about its foot. Static by definition: it does not go anywhere."""

    thing: Thing
    foot: tuple[float, float, float]
    amplitude: float
    period: float
    phase: float

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

    def __init__(self, rng: np.random.Generator, waves: Sequence[Range], roads: tuple[Road, ...], **ground: Any):
        """Take `roads` over hills of `waves` (`make_hills`); `ground` is for its `Terrain`."""
        self.terrain = Terrain(roads, make_hills(rng, waves), seed=int(rng.integers(1 << 30)), **ground)
        self.rng = rng
        self.agents: list[Agent] = []
        self.signals: list[Signal] = []
        self._scenery: list[Mesh] = []
        self._parked: list[tuple[Thing, Array]] = []
        self._swaying: list[Sway] = []
        self._taken: list[tuple[float, float, float]] = []

    def add_ego(self, path: Path, start: float, speed: float, **how: Any) -> None:
        """Put the car that carries the sensor on a path, before anyone else; `how` is for its `Agent`."""
        self.agents.append(Agent((make_car(self.rng, "estate"),), path, start, speed, **how))

    def add_agent(self, agent: Agent, clearance: float = 1.5) -> bool:
        """Add the agent if no outline of the others is within `clearance` metres; return whether it was added."""
        for other in self.agents:
            if other.enter > 0.0 or np.hypot(*(agent.outline[0] - other.outline[0])) > 40.0:
                continue
            apart = np.linalg.norm(agent.outline[:, None] - other.outline[None], axis=2).min()
            if apart < 0.5 * (agent.width + other.width) + clearance:
                return False
        self.agents.append(agent)
        return True

    def add(self, mesh: Mesh, place: Array, yaw: float = 0.0, z: float | None = None) -> None:
        """Put scenery at a place (x, y), on the ground or at height `z`."""
        x, y = place
        self._scenery.append(mesh.moved(x, y, self._height(place) if z is None else z, yaw))

    def plant(self, mesh: Mesh, place: Array, sway: float) -> None:
        """Put foliage on the ground that rocks in the wind by `sway` radians."""
        if sway:
            foot = (*place, self._height(place))
            period, phase = self.rng.uniform(1.5, 4.0), self.rng.uniform(0, 2 * np.pi)
            self._swaying.append(Sway(Thing("foliage", (mesh,)), foot, sway, period, phase))
        else:
            self.add(mesh, place)

    def park(self, thing: Thing, place: Array, yaw: float) -> None:
        """Put an object on the ground that never moves."""
        rear, front = thing.axles
        along = np.array([np.cos(yaw), np.sin(yaw)])
        z_rear, z_front = self.terrain.height(np.array([place + rear * along, place + front * along]))
        pitch = -np.arctan2(z_front - z_rear, front - rear) if front - rear > 0.5 else 0.0
        z = z_rear - rear / (front - rear) * (z_front - z_rear)
        self._parked.append((thing, np.array([*place, z, yaw, pitch, 0.0])))
        self._taken.append((*place, 0.0))

    def reserve(self, place: Array) -> None:
        """Keep a place free for somebody who will stop there."""
        self._taken.append((*place, 2.5))

    def _height(self, place: Array) -> float:
        return float(self.terrain.height(place[None])[0])

    def is_free(self, place: Array, radius: float) -> bool:
        """Whether nothing stands, waits to start or is to stop within `radius` metres of a place."""
        x, y = place.tolist()
        if any(np.hypot(a - x, b - y) < radius + more for a, b, more in self._taken):
            return False
        waiting = (a.outline for a in self.agents if a.enter <= 0.0)
        return all(np.hypot(*(outline - place).T).min() > radius for outline in waiting)

    def finish(self, duration: float, reach: float = 140.0, unevenness: float = 1.0) -> World:
        """Return the world after driving all agents for `duration` seconds; the first agent carries the sensor.

        The ground reaches `reach` metres beyond the roads; `unevenness` is that of the road under the ego.
        """
        agents, record = drive_unharmed(self.agents, self.signals, duration)
        motion = follow(agents, record, self.terrain, self.rng)
        ego_motion = ride(motion.state[:, 0], record.v[:, 0], self.rng, unevenness)
        movers = tuple(part for agent in agents for part in agent.parts)
        ground = self.terrain.mesh(reach)
        parked = tuple(thing for thing, _ in self._parked)
        states = np.array([state for _, state in self._parked]).reshape(-1, 6)
        standing = [thing.frames[0].transformed(T) for thing, T in zip(parked, transforms(states), strict=True)]
        pieces = [ground, *self._scenery, *standing]
        owner = [0] * (1 + len(self._scenery)) + list(range(1, len(standing) + 1))
        start = ego_motion.at(0.0)[:3, 3]
        return World(
            static=join(pieces),
            static_object=np.repeat(np.array(owner, np.int32), [len(p) for p in pieces]),
            parked=parked,
            parked_state=states,
            movers=movers[1:],
            motion=motion.of(np.arange(1, len(movers))),
            swaying=tuple(self._swaying),
            ego=ego_motion,
            ground_under_ego=float(self.terrain.height(start[None, :2])[0]),
        )
