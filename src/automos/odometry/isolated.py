"""Isolated points: beside the road, a few beams meet something too small for a surface, at one place of the path.

Surfaces facing along the path need several points each. On a motorway, 16 beams leave one or two on a post or a bush,
and no such surface is re-observed for seconds. A point with no other ahead or behind, at its height and offset from the
path, marks a position along the path as well: at 30 m/s, one in twenty or more is met again, and hardly any by chance.
A long wall or a crash barrier has no isolated points.
"""

import numpy as np
from scipy.spatial import KDTree

from automos.core.geometry import Array
from automos.core.scan import Pose
from automos.odometry.motion import signed_distance
from automos.odometry.surfels import SURFEL, Surfels, TimedPoints

ALONE = (3.0, SURFEL, SURFEL)
"""Metres along the path, across it and in height, to both sides of an isolated point, with no other point."""
CLOSE = 0.15
"""Metres along the path between what is observed and what it re-observes, at most, and half of those perpendicular to
it: errors of unrefined poses are smaller."""


def isolated_points(surfels: Surfels, forward: Array, overhead: float, beside: float) -> TimedPoints:
    """Return what is isolated along `forward` (3,), higher than `overhead` or farther than `beside` (metres) aside."""
    sparse = surfels[:0] if surfels.sparse is None else surfels.sparse
    points = np.concatenate([sparse.mean, surfels.mean])
    places = points @ _path_axes(forward)
    is_landmark = (points[:, 2] > overhead) | (np.abs(places[:, 1]) > beside)
    rows = np.flatnonzero(is_landmark[: len(sparse)])
    tree = KDTree(places[is_landmark] / ALONE, balanced_tree=False, compact_nodes=False)
    apart, _ = tree.query(places[rows] / ALONE, k=[2], p=np.inf, distance_upper_bound=1.0)  # the nearest is itself
    return sparse[rows[np.isinf(apart[:, 0])]]


def count_met_again(
    here: TimedPoints, there: TimedPoints, T_here_there: Pose, forward: Array, distances: Array, share: float
) -> Array:
    """Return (D,) how many isolated points are met again if the sensor travelled `distances` (D,) along its path.

    Parameters
    ----------
    here, there, T_here_there : of `isolated_points`, and the (4, 4) from one to the other.
    forward : (3,) direction of the path.
    share : of the distance, that which is travelled during a sweep: points are compensated for each distance.
    """
    present, direction = signed_distance(T_here_there, forward)
    axes = _path_axes(direction)
    first = here.mean @ axes
    second = (there.mean @ T_here_there[:3, :3].T + T_here_there[:3, 3]) @ axes - np.array([1.0, 0.0, 0.0]) * present
    if not len(first) or not len(second):
        return np.zeros(len(distances))
    here_at, there_at = KDTree(first[:, 1:]), KDTree(second[:, 1:])
    pairs = here_at.sparse_distance_matrix(there_at, 2.0 * CLOSE, output_type="ndarray")
    i, j = pairs["i"], pairs["j"]
    later = share * (there.time[j] - here.time[i])
    apart = (first[i, 0] - second[j, 0] + later * present) / (1.0 + later)
    # What is met at its place in the sensor's frame may be a ring's, on a wall that is seen at a grazing angle.
    stays = np.abs(apart) < CLOSE
    apart = apart[~np.isin(i, i[stays]) & ~np.isin(j, j[stays])]
    apart.sort()
    found = np.searchsorted(apart, distances + CLOSE) - np.searchsorted(apart, distances - CLOSE)
    return found.astype(np.float64)


def _path_axes(direction: Array) -> Array:
    """Return (3, 3) with the unit vectors along a path, level across it, and perpendicular to both as columns."""
    across = np.array([-direction[1], direction[0], 0.0]) / max(float(np.hypot(*direction[:2])), 1e-9)
    return np.column_stack([direction, across, np.cross(direction, across)])
