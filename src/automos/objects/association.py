"""Data association of detections and tracked objects: costs, gates and one optimal assignment (paper III-D)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from automos.core.geometry import Array
from automos.core.upright_boxes import Boxes, iou_3d
from automos.objects import filter as kalman
from automos.objects.detections import Detections
from automos.settings import AssociationSettings, FilterSettings, GateSettings

Rows = npt.NDArray[np.int64]
MAX_CLIMB = 1.5  # metres: greatest difference between predicted and measured height
MIN_OVERLAP = 0.3
"""Overlap of predicted and measured box in the ground plane, above which they may be the same wherever their centres
are: two solid objects cannot be in one place, and the centre of a lorry jumps by metres as its ends come into sight."""
MAX_COUNT_RATIO = 5.0  # greatest ratio of the numbers of points
SIZE_WEIGHT = 4.0  # cost of a change of size, in squared standard deviations
LEAST_SIDE = 0.1  # metres: of what is thinner, ratios of sides say nothing
EVIDENCE_WEIGHT = 8.0
"""Cost of a change from all points moving to all static: what comes back as a thing that has long stood there is
another one, and a person who passes a post stays one."""
ANOTHER = 20.0
"""Cost of the alternative to a pair, that the object is not seen and the detection is of another one. So a piece beside
its own whole, and a scrap that is offered the whole instead, are not swapped because two pairs are more than one."""


@dataclass(frozen=True, eq=False)
class Objects(kalman.Beliefs):
    """The K objects that are tracked at one time, and their states."""

    track: Rows  # number
    unseen: Array  # seconds since the last observation
    misses: Rows  # scans since then
    sights: Array  # scans in which it was observed
    scans: Array  # scans since its first
    share: Array  # in [0, 1], moving share of the evidence so far
    count: Array  # of points at the last observation


def association_cost(tracked: Boxes, detected: Boxes, settings: AssociationSettings) -> Array:
    """Return the (K, M) cost C = c_d + c_o + c_v; inf where a gate T_d, T_o or T_v forbids it (`paper`)."""
    c_d = cdist(tracked.center, detected.center)
    c_o = 1.0 - iou_3d(tracked, detected)
    v_i, v_j = tracked.volume[:, None], detected.volume[None, :]
    larger = np.maximum(v_i, v_j)
    c_v = 1.0 - np.divide(np.minimum(v_i, v_j), larger, out=np.zeros_like(c_d), where=larger > 0)
    is_new = (c_d > settings.max_distance) | (c_o > settings.max_overlap_cost) | (c_v > settings.max_volume_cost)
    return np.where(is_new, np.inf, c_d + c_o + c_v)


def motion_cost(objects: Objects, found: Detections, noise: FilterSettings, settings: GateSettings) -> Array:
    """Return the (K, M) cost of associating predicted objects with detections, inf where a gate forbids it (`default`).

    The paper's gates are in metres per scan: an object faster than 2 m per scan never gets a second observation, and
    one that shows another side changes its volume. Here the gate is the innovation covariance of the filter; its
    likelihood, size, height, number of points and evidence choose among the detections within it.
    """
    cost = np.full((len(objects), len(found)), np.inf)
    deviation = np.sqrt(objects.covariance[:, [0, 1], [0, 1]].max(axis=1, initial=0.0))
    reach = 1.5 * settings.gate * (deviation + np.sqrt(noise.measurement_variance))[:, None]
    (x, y), (found_x, found_y) = objects.mean[:, :2].T, found.boxes.center[:, :2].T
    # Most pairs are far apart.
    k, j = np.nonzero((np.abs(x[:, None] - found_x) < reach) & (np.abs(y[:, None] - found_y) < reach))
    mean, size, offset = objects.mean[k], found.boxes.size[j], found.boxes.center[j] - objects.mean[k, :3]
    spread = objects.covariance[k, :2, :2] + noise.measurement_variance * np.eye(2)
    squared, determinant = _mahalanobis(offset[:, :2], spread)
    overlap = _overlap(mean, offset, found.boxes.yaw[j], size)
    squared = np.minimum(squared, np.where(overlap > MIN_OVERLAP, (1.0 - overlap) * settings.gate**2, np.inf))
    climb = np.abs(offset[:, 2])
    before, now = (np.sort(np.maximum(sides, LEAST_SIDE), axis=-1) for sides in (mean[:, 4:6], size[:, :2]))
    growth = (np.abs(before - now) / (1.0 + np.maximum(before, now))).max(axis=-1, initial=0.0)
    # For an object of few points, a difference of a few points has no meaning.
    thinning = np.abs(np.log((objects.count[k] + 3.0) / (found.n_points[j] + 3.0)))
    settling = EVIDENCE_WEIGHT * np.abs(objects.share[k] - _moving_share(found)[j])
    is_possible = (squared < settings.gate**2) & (climb < MAX_CLIMB) & (thinning < np.log(MAX_COUNT_RATIO))
    # -2 log of the density's height: whose place is known explains a detection better than whose could be anywhere.
    vagueness = np.log(determinant) - 2.0 * np.log(noise.measurement_variance)
    vagueness -= 2.0 * np.log(_chance(objects.sights, objects.scans))[k]
    price = squared + vagueness + climb + SIZE_WEIGHT * growth + thinning + settling
    cost[k, j] = np.where(is_possible, price, np.inf)
    return cost


def cost_of_none(objects: Objects) -> Array:
    """Return (K, 1) what it costs that each object is not seen, and a detection is of another one.

    Equation: chance
    """
    return ANOTHER - 2.0 * np.log(_chance(objects.scans - objects.sights, objects.scans))[:, None]


def _moving_share(found: Detections) -> Array:
    """Return (M,) the moving share of each segment: of one that pieces were cut out of, that of the piece that most is.

    Both are what is seen of one thing: a car that halts is still whole when all but a piece of it has stayed.
    """
    share, is_piece = found.moving_share.copy(), found.part_of >= 0
    np.maximum.at(share, found.part_of[is_piece], share[is_piece])
    return share


def _chance(times: Array, of: Array) -> Array:
    """Return the probability that what happened so many `times` happens now (Laplace's rule of succession)."""
    return (times + 1.0) / (of + 2.0)


def _overlap(mean: Array, offset: Array, yaw: Array, size: Array) -> Array:
    """Return (P,) common length times common width of two boxes, each as a share of the longer of both.

    mean : (P, 10) of predicted objects.   offset : (P, 3) from these to the boxes of `yaw` (P,) and `size` (P, 3).
    """
    share = np.ones(len(offset))
    turn = yaw - mean[:, kalman.YAW]
    for axis in range(2):
        along = mean[:, kalman.YAW] + 0.5 * np.pi * axis
        at = np.abs(np.cos(along) * offset[:, 0] + np.sin(along) * offset[:, 1])
        own = np.maximum(mean[:, 4 + axis], LEAST_SIDE)
        c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
        other = np.maximum(c * size[:, axis] + s * size[:, 1 - axis], LEAST_SIDE)
        common = np.minimum(0.5 * (own + other) - at, np.minimum(own, other))
        share *= np.maximum(common, 0.0) / np.maximum(own, other)
    return share


def _mahalanobis(offset: Array, spread: Array) -> tuple[Array, Array]:
    """Return (P,) squared Mahalanobis lengths of `offset` (P, 2) under `spread` (P, 2, 2), and its determinants."""
    x, y, a, b, c = offset[:, 0], offset[:, 1], spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    determinant = a * c - b * b
    return (c * x * x - 2.0 * b * x * y + a * y * y) / determinant, determinant


def assign(cost: Array, alternative: Array | None = None) -> tuple[Rows, Rows]:
    """Return rows and columns of the assignment of least total cost, in which what has no pair costs `alternative`.

    By default that is the one with the most pairs and, among those, the least cost.

    cost : (K, M), inf where a pair is forbidden.   alternative : (K, 1)
    """
    if alternative is None:
        above_all = cost.max(initial=0.0, where=np.isfinite(cost)) + 1.0
        alternative = np.full((len(cost), 1), above_all * (min(cost.shape) + 1))
    saved = np.minimum(cost - alternative, 0.0)
    rows, columns = linear_sum_assignment(saved)
    keep = saved[rows, columns] < 0.0
    return rows[keep], columns[keep]
