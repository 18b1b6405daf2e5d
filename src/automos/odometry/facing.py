"""The share of surfaces facing along the path that are re-observed, as a function of the distance travelled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.kernels import kernel
from automos.odometry.submap import VOXEL, Submap
from automos.odometry.surfels import Surfels, key_at_level, level_of, variance_along
from automos.scan import Pose
from automos.voxels import VoxelMap, find_slot

CLOSE = 0.15
"""Metres between a surfel and a surface it re-observes, at most: errors of unrefined poses are smaller."""
EVIDENCE = 5.0
"""Re-observed surfels that count for half of full certainty."""
STANDSTILL_SHARE = 0.25
"""Least share of the overhead surfaces facing along the path that a stationary sensor re-observes."""
STANDSTILL_SHARE_LOW = 0.1
"""Least share of all surfaces facing along the path that a stationary sensor re-observes, if none is overhead."""
NEAR_SHARE = 0.5
"""Share of the surfaces facing along the path that are re-observed from nearly the same position."""
NEAR_VIEW = 1.5
"""Metres over which this share decreases to a third."""

BESIDE = 12.0
"""Metres from the path, beyond all lanes of the sensor's own direction: nothing there keeps pace with the sensor."""

BODY_RANGE = 6.0
"""Metres within which the ego body is searched: up to the ends of a long vehicle."""
BODY_VOXEL = 0.4
"""Metres, edge of the voxels in which positions are compared, the same as for surfels."""
BODY_SHARE = 0.8
"""Share of the scans that must observe it at the same position."""
BODY_SPREAD = 0.04
"""Metres, deviation of that position: noise of a surfel."""

Array = npt.NDArray[np.float64]


def signed_distance(T_start_end: Pose, forward: Array) -> tuple[Array, Array]:
    """Return the (...,) metres travelled, negative backwards, and the (..., 3) forward direction."""
    travelled = T_start_end[..., :3, 3]
    length = np.linalg.norm(travelled, axis=-1)
    sign = np.where(travelled @ forward < 0.0, -1.0, 1.0)
    direction = sign[..., None] * travelled / np.maximum(length, 1e-9)[..., None]
    return sign * length, np.where((length > 0.5)[..., None], direction, forward)


def score_distances(
    submap: Submap,
    surfels: Surfels,
    T_submap_surfels: Pose,
    forward: Array,
    distances: Array,
    per_sweep: float,
    overhead: float,
) -> Array:
    """Return how much surface facing along the path is re-observed if the sensor has travelled `distances` (D,) metres.

    Returns (3, D): surfaces that may be vehicles keeping pace, surfaces too far beside the path for that, and surfaces
    higher than any vehicle, `overhead` metres above the sensor. The compensation of the surfels is adapted:
    `per_sweep` is the share of the distance that is travelled during a sweep.
    """
    scores = np.zeros((3, len(distances)))
    present, direction = signed_distance(T_submap_surfels, forward)
    sideways = T_submap_surfels[:3, 3] - present * direction
    R = np.ascontiguousarray(T_submap_surfels[:3, :3])
    shift = per_sweep * (distances - present)
    _score(
        submap.arrays, surfels.mean, surfels.covariance, surfels.time, R, sideways, direction, distances, shift,
        overhead, scores,
    )  # fmt: skip
    return scores


def without_body(surfels: list[Surfels]) -> list[Surfels]:
    """Return the surfels of consecutive scans, each in its sensor frame, without those of the ego body.

    Surfels near the sensor that nearly every scan has at the same position within centimetres belong to the vehicle (or
    to ground so even that it is not needed). At standstill, all surfels do.
    """
    if not surfels:
        return []
    is_near = [np.einsum("ij,ij->i", s.mean, s.mean) < BODY_RANGE**2 for s in surfels]
    means = np.concatenate([s.mean[near] for s, near in zip(surfels, is_near, strict=True)]).astype(np.float64)
    voxel = VoxelMap(BODY_VOXEL).add(means)
    count = np.bincount(voxel)
    spread = np.zeros(len(count))
    for axis in range(3):
        mean = np.bincount(voxel, means[:, axis], len(count)) / count
        spread += np.bincount(voxel, (means[:, axis] - mean[voxel]) ** 2, len(count)) / count
    is_body = ((count > BODY_SHARE * len(surfels)) & (spread < BODY_SPREAD**2))[voxel]
    out = []
    for scan, near in zip(surfels, is_near, strict=True):
        keep = np.ones(len(scan), bool)
        n = int(near.sum())
        keep[near] = ~is_body[:n]
        is_body = is_body[n:]
        out.append(scan[keep])
    return out


def is_stationary(refound: Array, whole: Array) -> bool:
    """Return whether as much of `whole` (3,) is re-observed in place as by a stationary sensor.

    Overhead surfaces decide if there are any; nearly all lower ones may be traffic.
    """
    if whole[2] > EVIDENCE:
        return bool(refound[2] > STANDSTILL_SHARE * whole[2])
    return bool(refound.sum() > STANDSTILL_SHARE_LOW * whole.sum())


def expected_share(distances: Array) -> Array:
    """Return the least share (D,) of the surfaces facing along the path that is re-observed after `distances` (D,).

    From nearly the same position, nearly all are; a sensor that keeps pace with traffic re-observes little else.
    """
    return NEAR_SHARE * np.exp(-np.abs(distances) / NEAR_VIEW)


@kernel
def _score(  # type: ignore[no-untyped-def]
    submap, points, covariance, times, R, offset, direction, distances, shift, overhead, scores
):  # fmt: skip
    keys, rows, mean, axes, variance = submap
    inverse_voxel = 1.0 / VOXEL
    constrains = np.zeros(len(mean))  # how much each voxel constrains the position along the path
    for row in range(len(mean)):
        for k in range(2):
            if variance[row, k] < 0.0:
                break
            constrains[row] += (
                axes[row, k, 0] * direction[0] + axes[row, k, 1] * direction[1] + axes[row, k, 2] * direction[2]
            ) ** 2
    n_constraining = 0
    for slot in range(len(keys)):
        if keys[slot] != -1 and constrains[rows[slot]] > 0.1:
            n_constraining += 1
    size = 16
    while size < 4 * n_constraining:
        size *= 2
    few_keys, few_rows = np.full(size, -1, np.int64), np.zeros(size, np.int32)  # small enough for the cache
    for slot in range(len(keys)):
        if keys[slot] != -1 and constrains[rows[slot]] > 0.1:
            few = find_slot(few_keys, keys[slot])
            few_keys[few] = keys[slot]
            few_rows[few] = rows[slot]
    a = np.empty(3)
    for k in range(3):  # direction of the path in the surfels' frame
        a[k] = R[0, k] * direction[0] + R[1, k] * direction[1] + R[2, k] * direction[2]
    for i in range(len(points)):
        c = covariance[i]
        if variance_along(c, a) > 0.2 * (c[0] + c[3] + c[5]):  # surface parallel to the path
            continue
        px, py, pz = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        x0 = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + offset[0]
        y0 = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + offset[1]
        z0 = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + offset[2]
        where = 2 if points[i, 2] > overhead else (1 if abs(a[0] * py - a[1] * px) > BESIDE else 0)
        for d in range(len(distances)):
            e = distances[d] + times[i] * shift[d]
            x, y, z = x0 + e * direction[0], y0 + e * direction[1], z0 + e * direction[2]
            slot = find_slot(few_keys, key_at_level(x, y, z, level_of(x, y, z), inverse_voxel))
            if few_keys[slot] == -1:
                continue
            row = few_rows[slot]
            worst = 0.0
            for k in range(2):
                if variance[row, k] < 0.0:
                    break
                off = axes[row, k, 0] * (x - mean[row, 0]) + axes[row, k, 1] * (y - mean[row, 1])
                worst = max(worst, abs(off + axes[row, k, 2] * (z - mean[row, 2])))
            if worst < CLOSE:
                scores[where, d] += constrains[row]
