"""What an annotator would draw: an upright box around every object of which a scan holds points."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, transform, wrap_angle
from automos.core.upright_boxes import Boxes
from automos.simulation.traffic.motion import transforms
from automos.simulation.world import World


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
    for k, state in zip(rows, states, strict=True):
        thing = world.objects[k]
        level = state.copy()
        level[3] = 0.0
        low, high = thing.bounds
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        corners = transform(transforms(level), corners)
        a, b = corners.min(axis=0), corners.max(axis=0)
        turned = transforms(np.array([*state[:3], state[3], 0.0, 0.0]))
        center.append(transform(turned, (0.5 * (a + b) - state[:3])[None])[0])
        size.append(b - a)
    return Boxes(np.array(center), np.array(size), wrap_angle(states[:, 3]), np.ones(len(rows)))
