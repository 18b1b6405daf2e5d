"""What is true of a world: which objects move at some time while observed, and the boxes an annotator would draw.

Motion is judged by SemanticKITTI's rule, from the true one: a car that waits at the light and then drives is moving
throughout; one that only moves where nobody could see it is not. "Observed" means that a scan holds a point of it.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, transform, wrap_angle
from automos.core.upright_boxes import Boxes
from automos.simulation.traffic.motion import transforms
from automos.simulation.world import World

CERTAIN_MOTION = 0.5
"""Metres between two observed places from which on an annotator calls an object moving."""
CERTAIN_REST = 0.1
"""Metres below which an annotator calls it static; in between it is unlabeled."""


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


def judge(world: World, is_seen: npt.NDArray[np.bool_], stamps: Array, period: float) -> Verdicts:
    """Return which objects move while observed.

    is_seen : (S, K) whether the scan at each of the `stamps` (S,), the middle of a sweep of `period` seconds, holds a
        point of each object.
    """
    first, moved = np.full((len(world.objects), 3), np.nan), np.zeros(len(world.objects))
    for seen, time in zip(is_seen, stamps.tolist(), strict=True):
        before, after = (world.object_states(time + side)[0][seen, :3] for side in (-0.5 * period, 0.5 * period))
        first[seen] = np.where(np.isnan(first[seen]), before, first[seen])
        moved[seen] = np.maximum(moved[seen], np.linalg.norm(after - first[seen], axis=1))
    was_seen = ~np.isnan(first[:, 0])
    was_seen[: len(world.parked)] = True
    return Verdicts(moved > CERTAIN_MOTION, was_seen & (moved < CERTAIN_REST))


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
