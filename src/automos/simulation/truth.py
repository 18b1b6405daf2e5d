"""What is true of a world: which objects move at some time while observed, and the boxes an annotator would draw.

Motion is judged by SemanticKITTI's rule, from the true one: a car that waits at the light and then drives is moving
throughout; one that only moves where nobody could see it is not. "Observed" means that an unobstructed line leads from
the sensor to it at mid-sweep.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, transform, wrap_angle
from automos.core.upright_boxes import Boxes
from automos.simulation.sensing.scene import Scene
from automos.simulation.sensing.sensors import Sensor
from automos.simulation.traffic.motion import transforms
from automos.simulation.world import World

CERTAIN_MOTION = 0.5
"""Metres between two observed places from which on an annotator calls an object moving."""
CERTAIN_REST = 0.1
"""Metres below which an annotator calls it static; in between it is unlabeled."""
_SIGHTS = np.array([[0.0, 0.0, 0.2], *([0.4 * x, 0.4 * y, z] for x in (-1, 1) for y in (-1, 1) for z in (-0.2, 0.35))])
"""(L, 3) points of an object that are looked at: shares of its size, from its middle."""


@dataclass(frozen=True, eq=False)
class Verdicts:
    """Over all K objects of a world.

    Attributes
    ----------
    is_moving, is_static : (K,) bool
        Neither if it is not known.
    """

    is_moving: npt.NDArray[np.bool_]
    is_static: npt.NDArray[np.bool_]


def judge(world: World, still: Scene, sensor: Sensor, T_site_sensor: Array, stamps: Array) -> Verdicts:
    """Return which objects move while observed from the (S, 4, 4) poses at the (S,) `stamps`.

    `still` is the scene of all that stands still: what hides an object.
    """
    n_parked, n_movers = len(world.parked), len(world.movers)
    first = np.full((n_movers, 3), np.nan)
    moved = np.zeros(n_movers)
    half = 0.5 * sensor.period
    for T, time in zip(T_site_sensor, stamps, strict=True):
        state, _, present = world.motion.at(float(time))
        seen = np.flatnonzero(present)
        seen = seen[_in_sight(world, still, sensor, T, state, seen)]
        sweep = [world.motion.at(float(time) + side * half)[0][seen, :3] for side in (-1.0, 1.0)]
        new = np.isnan(first[seen, 0])
        first[seen[new]] = sweep[0][new]
        moved[seen] = np.maximum(moved[seen], np.linalg.norm(sweep[1] - first[seen], axis=1))
    was_seen = ~np.isnan(first[:, 0])
    is_moving = np.concatenate([np.zeros(n_parked, bool), moved > CERTAIN_MOTION])
    is_static = np.concatenate([np.ones(n_parked, bool), was_seen & (moved < CERTAIN_REST)])
    return Verdicts(is_moving, is_static)


def _in_sight(
    world: World, still: Scene, sensor: Sensor, T: Array, state: Array, rows: npt.NDArray
) -> npt.NDArray[np.bool_]:
    """Return (len(rows),) bool: whether any looked-at point of each mover is within reach and not hidden."""
    if len(rows) == 0:
        return np.zeros(0, bool)
    local = np.array([world.movers[k].center + _SIGHTS * world.movers[k].size for k in rows])  # (M, L, 3)
    pose = transforms(state[rows])
    targets = np.einsum("mij,mlj->mli", pose[:, :3, :3], local) + pose[:, None, :3, 3]
    line = targets - T[:3, 3]
    distance = np.linalg.norm(line, axis=2)
    direction = (line / distance[..., None]).reshape(-1, 3).astype(np.float32)
    origin = np.broadcast_to(T[:3, 3].astype(np.float32), direction.shape).copy()
    face, _ = still.first(origin, direction, distance.ravel().astype(np.float32))
    in_view = distance < sensor.max_range
    if sensor.rosette:
        in_view &= np.abs(np.arctan2(line @ T[:3, 1], line @ T[:3, 0])) < 0.5 * np.radians(sensor.rosette[0])
    return np.any((face.reshape(distance.shape) < 0) & in_view, axis=1)


@dataclass(frozen=True, eq=False)
class Annotations:
    """The objects of which a scan holds points, in the level frame at mid-sweep.

    Attributes
    ----------
    boxes : K upright boxes around the whole objects; the score is 1.
    ids : (K,) int32 instance ids, constant over the sequence, as in the upper 16 bits of the labels.
    kinds : K names.
    is_moving : (K,) bool, moves at some time while observed.
    is_moving_now : (K,) bool.
    n_points : (K,) int64 points of this scan on it.
    """

    boxes: Boxes
    ids: npt.NDArray[np.int32]
    kinds: tuple[str, ...]
    is_moving: npt.NDArray[np.bool_]
    is_moving_now: npt.NDArray[np.bool_]
    n_points: npt.NDArray[np.int64]


def upright_boxes(world: World, rows: npt.NDArray, states: Array) -> Boxes:
    """Return site-frame boxes around objects `rows` of `world` in (K, 6) `states`, grown where one pitches or rolls."""
    if len(rows) == 0:
        return Boxes.empty()
    center, size = [], []
    for k, (x, y, z, yaw, pitch, roll) in zip(rows, states, strict=True):
        level, turned = transforms(np.array([[x, y, z, 0.0, pitch, roll], [x, y, z, yaw, 0.0, 0.0]]))
        corners = transform(level, np.array(list(product(*world.objects[k].bounds.T))))
        low, high = corners.min(axis=0), corners.max(axis=0)
        center.append(transform(turned, (0.5 * (low + high) - (x, y, z))[None])[0])
        size.append(high - low)
    return Boxes(np.array(center), np.array(size), wrap_angle(states[:, 3]), np.ones(len(rows)))
