"""Which detection is which tracked object: three costs, three gates, one optimal assignment (paper III-D)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from automos.settings import AssociationSettings
from automos.upright_boxes import Boxes, iou_3d


def association_cost(tracked: Boxes, detected: Boxes, settings: AssociationSettings) -> npt.NDArray[np.float64]:
    """Return the (K, M) cost C = a_d c_d + a_o c_o + a_v c_v; inf where a gate T_d, T_o or T_v forbids the pair."""
    c_d = cdist(tracked.center, detected.center)
    c_o = 1.0 - iou_3d(tracked, detected)
    v_i, v_j = tracked.volume[:, None], detected.volume[None, :]
    larger = np.maximum(v_i, v_j)
    c_v = 1.0 - np.divide(np.minimum(v_i, v_j), larger, out=np.zeros_like(c_d), where=larger > 0)
    cost = settings.weight_distance * c_d + settings.weight_overlap * c_o + settings.weight_volume * c_v
    is_new = (c_d > settings.max_distance) | (c_o > settings.max_overlap_cost) | (c_v > settings.max_volume_cost)
    return np.where(is_new, np.inf, cost)


def assign(cost: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return rows and columns of the assignment with the most pairs and, among those, the least total cost.

    cost : (K, M), inf where a pair is forbidden (Hungarian method; a finite stand-in, since SciPy refuses rows of inf).
    """
    is_allowed = np.isfinite(cost)
    if not is_allowed.any():
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    forbidden = (cost[is_allowed].max() + 1.0) * (min(cost.shape) + 1)
    rows, columns = linear_sum_assignment(np.where(is_allowed, cost, forbidden))
    keep = is_allowed[rows, columns]
    return rows[keep], columns[keep]
