"""What every beam of a sweep hits: the still world once, every moving body in its own frame, the nearest hit wins.

A beam leaves from where the sensor is at the beam's own time, and a moving body is cast at where it is at that time, so
sweeps are distorted by both motions as real ones are.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from automos.core.geometry import Array, inverse
from automos.core.kernels import kernel
from automos.simulation.rigs import Rig, placed, rigs
from automos.simulation.sensing.scene import EGO, Hits, Scene
from automos.simulation.sensing.sensors import SECTORS, Array32, Pattern
from automos.simulation.shapes.mesh import Mesh
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.motion import transforms
from automos.simulation.traffic.paths import Range
from automos.simulation.world import World

_OWN_TURN = 0.06
"""Radians, more than a sensor turns with its vehicle during half a sweep."""


@dataclass(frozen=True, eq=False)
class _Body:
    """What moves or sways during a sweep: the shape it shows, whose it is, and its states at the start and end."""

    mesh: Mesh
    owner: int
    thing: Thing
    start: Array
    end: Array


class Caster:
    """Casts beams into a world. Holds the ray tracer's trees: cheap to use, not to be pickled."""

    def __init__(self, world: World, rig: Rig | None = None):
        """Build the tree of what stands still in `world`; those of moving bodies are built when first needed."""
        self._world = world
        self._rig = rig or rigs()["car"]
        self.still = Scene(world.static, world.static_object)
        self._scenes: dict[tuple[Mesh, int], Scene] = {}

    def sweep(
        self, pattern: Pattern, T_site_sensor: Array, T_body_sensor: Array, times: Range, reach: float, chance: Array32
    ) -> Hits:
        """Return what each beam of a sweep hits first: the ego itself, the still world, or a body on the move.

        Parameters
        ----------
        pattern : Pattern
            N beams.
        T_site_sensor : (C, 4, 4) float64
            The sensor's pose at each column.
        T_body_sensor : (4, 4) float64
            Its place on the ego vehicle.
        times : tuple[float, float]
            Seconds, start and end of the sweep.
        reach : float
            Metres.
        chance : (N,) array
            In [0, 1), decides what panes do with each beam.
        """
        hits = Hits.none(len(pattern.direction), reach)
        for part in self._rig.parts:
            frame, T_body_part = placed(part, self._world.ego, 0.5 * sum(times))
            T = inverse(T_body_part) @ T_body_sensor
            own = np.einsum("ij,kj->ik", pattern.direction, T[:3, :3]).astype(np.float32)
            mount = np.broadcast_to(T[:3, 3].astype(np.float32), own.shape).copy()
            self._scene(part.frames[frame], EGO).cast(mount, own, hits, None, chance)
        origin, direction = np.empty((2, len(pattern.direction), 3), np.float32)
        _carry(pattern.direction, pattern.column, T_site_sensor, origin, direction)
        self.still.cast(origin, direction, hits, None, chance)
        T_middle = T_site_sensor[len(T_site_sensor) // 2]
        drift = float(np.linalg.norm(T_site_sensor[[0, -1], :3, 3] - T_middle[:3, 3], axis=1).max())
        for body in self._bodies(*times):
            where = _around(body, T_middle, drift)
            rows = _near(*pattern.by_sector, origin, direction, hits.distance, *where)
            if len(rows):
                own_origin, own = np.empty((2, len(rows), 3), np.float32)
                _into_body(origin, direction, pattern.phase, rows, body.start, body.end, own_origin, own)
                self._scene(body.mesh, body.owner).cast(own_origin, own, hits, rows, chance[rows])
        return hits

    def _bodies(self, start: float, end: float) -> Iterator[_Body]:
        world = self._world
        state_a, travelled, present_a = world.motion.at(start)
        state_b, _, present_b = world.motion.at(end)
        for k in np.flatnonzero(present_a & present_b).tolist():
            thing, owner = world.movers[k], len(world.parked) + k + 1
            mesh = thing.frames[int(travelled[k] / thing.stride * len(thing.frames)) % len(thing.frames)]
            yield _Body(mesh, owner, thing, state_a[k], state_b[k])
        for sway in world.swaying:
            yield _Body(sway.thing.frames[0], 0, sway.thing, sway.state(start), sway.state(end))

    def _scene(self, mesh: Mesh, owner: int) -> Scene:
        key = mesh, owner
        if key not in self._scenes:
            self._scenes[key] = Scene(mesh, owner)
        return self._scenes[key]


@kernel
def _carry(direction, column_of, poses, origins, turned):  # type: ignore[no-untyped-def]
    for i in range(len(direction)):
        T = poses[column_of[i]]
        x, y, z = direction[i]
        for k in range(3):
            turned[i, k] = T[k, 0] * x + T[k, 1] * y + T[k, 2] * z
            origins[i, k] = T[k, 3]


def _around(body: _Body, T_middle: Array, drift: float) -> tuple[int, int, Array, float]:
    """Return the first and the number of sectors whose beams may hit `body`, and its sphere over the whole sweep.

    `T_middle` is where the sensor is at mid-sweep, `drift` the metres that it moves during half the sweep.
    """
    middle = transforms(0.5 * (body.start + body.end))
    center = middle[:3, :3] @ body.thing.center + middle[:3, 3]
    own_motion = 0.5 * float(np.linalg.norm(body.end[:3] - body.start[:3]))
    radius = body.thing.radius * (1.0 + 0.6 * abs(body.end[3] - body.start[3])) + own_motion
    x, y, _ = inverse(T_middle)[:3] @ [*center, 1.0]
    away, wide = np.hypot(x, y), radius + drift
    half = np.pi if wide >= away else np.arcsin(wide / away) + _OWN_TURN
    first = int(np.floor((np.arctan2(y, x) - half) / (2 * np.pi) * SECTORS))
    return first, min(int(np.ceil(2 * half / (2 * np.pi) * SECTORS)) + 1, SECTORS), center, radius


@kernel
def _near(by_sector, starts, origins, directions, distance, first, n_sectors, center, radius):  # type: ignore[no-untyped-def]
    """Return the rows of beams in some sectors that may meet a sphere nearer than `distance`."""
    n_all = len(starts) - 1
    rows = np.empty(len(origins), np.int64)
    n = 0
    r2 = radius * radius
    for sector in range(first, first + n_sectors):
        for j in range(starts[sector % n_all], starts[sector % n_all + 1]):
            i = by_sector[j]
            x, y, z = center[0] - origins[i, 0], center[1] - origins[i, 1], center[2] - origins[i, 2]
            along = x * directions[i, 0] + y * directions[i, 1] + z * directions[i, 2]
            off2 = x * x + y * y + z * z - along * along
            if off2 > r2 or along < -radius or along - np.sqrt(r2 - off2) > distance[i]:
                continue
            rows[n] = i
            n += 1
    return rows[:n].copy()


@kernel
def _into_body(origins, directions, phase, rows, start, end, local_origins, local_directions):  # type: ignore[no-untyped-def]
    state = np.empty(6)
    for j in range(len(rows)):
        i = rows[j]
        for k in range(6):
            state[k] = start[k] + (phase[i] + 0.5) * (end[k] - start[k])
        _, _, _, yaw, pitch, roll = state
        cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
        x, y, z = origins[i, 0] - state[0], origins[i, 1] - state[1], origins[i, 2] - state[2]
        a, b, c = directions[i]
        forward = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
        left = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
        up = -sp, cp * sr, cp * cr
        for k in range(3):
            local_origins[j, k] = forward[k] * x + left[k] * y + up[k] * z
            local_directions[j, k] = forward[k] * a + left[k] * b + up[k] * c
