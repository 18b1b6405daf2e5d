"""Where every body is at any time: poses between which is interpolated; and how the one with the sensor shakes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.simulation.terrain import Terrain
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.driving import DT
from automos.simulation.traffic.paths import STEP

WANDER_LENGTH = 47.0
"""Metres after which a road user has strayed to both sides once."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of M bodies, every DT seconds.

    Attributes
    ----------
    state : (T, M, 6) x, y, z in metres, yaw (continuous), pitch, roll in radians; R = Rz(yaw) Ry(pitch) Rx(roll).
    travelled : (T, M) metres along the path.
    present : (T, M) bool.
    """

    state: Array
    travelled: Array
    present: npt.NDArray[np.bool_]

    def of(self, rows: npt.NDArray[np.int64]) -> Motion:
        """Return the motion of some of the bodies."""
        return Motion(self.state[:, rows], self.travelled[:, rows], self.present[:, rows])

    def at(self, time: float) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
        """Return ((M, 6) state, (M,) travelled, (M,) present) at `time` seconds, held beyond the ends."""
        k = min(max(time / DT, 0.0), len(self.state) - 1.001)
        i, f = int(k), k - int(k)
        state = (1.0 - f) * self.state[i] + f * self.state[i + 1]
        travelled = (1.0 - f) * self.travelled[i] + f * self.travelled[i + 1]
        return state, travelled, self.present[i] & self.present[i + 1]


def transforms(state: Array) -> Array:
    """Return (..., 4, 4) transforms of states (..., 6), body to site."""
    x, y, z, yaw, pitch, roll = np.moveaxis(state, -1, 0)
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    zero = np.zeros_like(x)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
        [-sp, cp * sr, cp * cr, z],
        [zero, zero, zero, zero + 1.0],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def follow(agents: list[Agent], record: np.recarray, terrain: Terrain, rng: np.random.Generator) -> Motion:
    """Return the poses of all parts of all `agents`, in order: both axles of a part lie on the path, on the ground."""
    states, travelled, present = [], [], []
    for a, agent in enumerate(agents):
        phase = rng.uniform(0, 2 * np.pi)
        for part, gap in zip(agent.parts, agent.gaps, strict=True):
            s = record.s[:, a] - gap
            states.append(_part_states(agent, part.axles, s, record.side[:, a], terrain, phase))
            travelled.append(s)
            present.append(record.present[:, a])
    return Motion(np.stack(states, axis=1), np.stack(travelled, axis=1), np.stack(present, axis=1))


def _part_states(
    agent: Agent, axles: tuple[float, float], s: Array, side: Array, terrain: Terrain, phase: float
) -> Array:
    rear_x, front_x = axles
    points, heights = [], []
    for axle in axles:
        along = np.clip(s + axle, 0.0, agent.path.length)
        offset = side + agent.wander * np.sin(2 * np.pi * along / WANDER_LENGTH + phase)
        xy, _ = agent.path.at(along, offset)
        raised = np.interp(along / STEP, np.arange(len(agent.path.z)), agent.path.z)
        points.append(xy)
        heights.append(np.where(raised > 0.5, terrain.base(xy), terrain.height(xy)) + raised)
    (rear, front), (z_rear, z_front) = points, heights
    yaw = np.unwrap(np.arctan2(*(front - rear).T[::-1]))
    level = np.zeros_like(yaw)
    pitch = level if front_x - rear_x < 0.5 else -np.arctan2(z_front - z_rear, front_x - rear_x)  # people stay upright
    share = -rear_x / (front_x - rear_x)
    x, y = (rear - rear_x * np.column_stack([np.cos(yaw), np.sin(yaw)])).T
    return np.column_stack([x, y, z_rear + share * (z_front - z_rear), yaw, pitch, level])


PITCH_PER_ACCELERATION = 0.006
"""rad per m/s^2: the nose dives when braking."""
ROLL_PER_ACCELERATION = 0.007
"""rad per m/s^2: the body leans out of the bend."""
SHAKE = (0.008, 0.0042, 0.0042)
"""Heave in metres, pitch and roll in radians: how far an uneven road moves the body (standard deviation)."""
SHAKE_SPEED = 2.5
"""m/s from which on a road shakes the body fully; slower, in proportion."""
BUMPS = (2.0, 20.0)
"""Metres, wavelengths of the unevenness."""
BODY_INERTIA = 0.12
"""Seconds over which a body evens out the corners of its wheels' motion."""
SETTLING = 0.25
"""Seconds in which the suspension follows."""


@dataclass(frozen=True, eq=False)
class EgoMotion:
    """Poses of the ego vehicle's body.

    Attributes
    ----------
    state : (T, 6) float64
        As in `Motion`, every DT seconds, suspension included.
    """

    state: Array

    @cached_property
    def _spline(self):  # type: ignore[no-untyped-def]
        from scipy.interpolate import CubicSpline

        return CubicSpline(DT * np.arange(len(self.state)), self.state, axis=0)

    def at(self, time: npt.ArrayLike) -> Array:
        """Return (..., 4, 4) T_site_body at `time` seconds."""
        time = np.clip(np.asarray(time, np.float64), 0.0, DT * (len(self.state) - 1))
        return transforms(self._spline(time))


def ride(state: Array, speed: Array, rng: np.random.Generator, unevenness: float = 1.0) -> EgoMotion:
    """Return the ego's motion from its wheels' (T, 6) `state` and (T,) `speed`: braking, bends and bumps move the body.

    `unevenness` is 1 for a city street with patches and cobbles, less for smoother roads.
    """
    out = _smooth(state, BODY_INERTIA)
    out[:, 4] -= PITCH_PER_ACCELERATION * _smooth(np.gradient(speed, DT), SETTLING)
    out[:, 5] += ROLL_PER_ACCELERATION * _smooth(speed * np.gradient(state[:, 3], DT), SETTLING)
    travelled = np.cumsum(speed) * DT
    strength = unevenness * _smooth(np.clip(speed / SHAKE_SPEED, 0.0, 1.0), SETTLING)
    for column, amplitude in zip((2, 4, 5), SHAKE, strict=True):
        waves = np.exp(rng.uniform(np.log(BUMPS[0]), np.log(BUMPS[1]), 8))
        weights = np.sqrt(2.0) * waves / (waves + 4.0) / np.sqrt(len(waves))  # springs swallow the short ones
        phases = rng.uniform(0, 2 * np.pi, len(waves))
        bumps = weights * np.sin(2 * np.pi * travelled[:, None] / waves + phases)
        out[:, column] += amplitude * strength * bumps.sum(axis=1)
    return EgoMotion(out)


def _smooth(values: Array, seconds: float) -> Array:
    """Return `values` (T, ...) smoothed over time; beyond the ends they are taken to go on as they went."""
    from scipy.ndimage import gaussian_filter1d

    margin = min(int(5 * seconds / DT), len(values) - 1)
    padded = np.pad(values, [(margin, margin)] + [(0, 0)] * (values.ndim - 1), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(padded, seconds / DT, axis=0)[margin : margin + len(values)]
