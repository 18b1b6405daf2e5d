"""Where every body is at any time: sampled poses, interpolated between samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.simulation.terrain import Terrain
from automos.simulation.traffic.agents import Agent
from automos.simulation.traffic.driving import DT, Drive
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

    def at(self, time: float) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
        """Return ((M, 6) state, (M,) travelled, (M,) present) at `time` seconds, held beyond the ends."""
        k = min(max(time / DT, 0.0), len(self.state) - 1.001)
        i, f = int(k), k - int(k)
        state = (1.0 - f) * self.state[i] + f * self.state[i + 1]
        travelled = (1.0 - f) * self.travelled[i] + f * self.travelled[i + 1]
        return state, travelled, self.present[i] & self.present[i + 1]


def rotations(state: Array) -> Array:
    """Return (..., 3, 3) rotation matrices of states (..., 6)."""
    yaw, pitch, roll = state[..., 3], state[..., 4], state[..., 5]
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=-2,
    )


def transforms(state: Array) -> Array:
    """Return (..., 4, 4) transforms of states (..., 6), body to site."""
    T = np.zeros((*state.shape[:-1], 4, 4))
    T[..., :3, :3] = rotations(state)
    T[..., :3, 3] = state[..., :3]
    T[..., 3, 3] = 1.0
    return T


def follow(agents: list[Agent], record: Drive, terrain: Terrain, rng: np.random.Generator) -> Motion:
    """Return the poses of all parts of all `agents`, in order: both axles of a part lie on the path, on the ground."""
    states, travelled, present = [], [], []
    for a, agent in enumerate(agents):
        phase = rng.uniform(0, 2 * np.pi)
        for part, gap in zip(agent.parts, agent.gaps, strict=True):
            s = record.s[:, a] - gap
            states.append(_part_states(agent, part.axles, s, record.side[:, a], terrain, phase))
            travelled.append(s)
            present.append(record.present[:, a])
    if not states:
        n = len(record.s)
        return Motion(np.zeros((n, 0, 6)), np.zeros((n, 0)), np.zeros((n, 0), np.bool_))
    return Motion(np.stack(states, axis=1), np.stack(travelled, axis=1), np.stack(present, axis=1))


def _part_states(
    agent: Agent, axles: tuple[float, float], s: Array, side: Array, terrain: Terrain, phase: float
) -> Array:
    rear_x, front_x = axles
    points, heights = [], []
    for axle in (rear_x, front_x):
        along = np.clip(s + axle, 0.0, agent.path.length)
        offset = side + agent.wander * np.sin(2 * np.pi * along / WANDER_LENGTH + phase)
        xy, _ = agent.path.at(along, offset)
        raised = np.interp(along / STEP, np.arange(len(agent.path.z)), agent.path.z)
        points.append(xy)
        heights.append(np.where(raised > 0.5, terrain.base(xy), terrain.height(xy)) + raised)
    (rear, front), (z_rear, z_front) = points, heights
    yaw = np.unwrap(np.arctan2(front[:, 1] - rear[:, 1], front[:, 0] - rear[:, 0]))
    pitch = -np.arctan2(z_front - z_rear, front_x - rear_x)
    share = -rear_x / (front_x - rear_x)
    x = rear[:, 0] - rear_x * np.cos(yaw)
    y = rear[:, 1] - rear_x * np.sin(yaw)
    z = z_rear + share * (z_front - z_rear)
    if front_x - rear_x < 0.5:  # a person stays upright
        pitch = np.zeros_like(pitch)
    return np.column_stack([x, y, z, yaw, pitch, np.zeros_like(x)])
