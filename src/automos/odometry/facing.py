"""How much of the surface that faces along the path is found again, as a function of the distance travelled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.kernels import kernel
from automos.odometry.submap import VOXEL, Submap
from automos.odometry.surfels import Surfels, key_at_level, level_of, variance_along
from automos.scan import Pose
from automos.voxels import VoxelMap, find_slot

CLOSE = 0.15
"""Metres, surfels nearer to a surface than this have found it again: poses that are not yet refined are off by less."""
EVIDENCE = 5.0
"""Surfels found again that count for half of full certainty."""
STANDSTILL_SHARE = 0.25
"""Of what is overhead and faces along the path, found where it was by one who stands."""
STANDSTILL_SHARE_LOW = 0.1
"""Of all that faces along the path, the same where nothing is overhead."""
NEAR_SHARE = 0.5
"""Of what faces along the path, found again from nearly the same place."""
NEAR_VIEW = 1.5
"""Metres over which this falls to a third."""

BESIDE = 12.0
"""Metres from the sensor's path, farther than lanes of its own direction reach: what is there keeps no pace with it."""

BODY_RANGE = 6.0
"""Metres within which the vehicle's own body is looked for: a long one's ends."""
BODY_VOXEL = 0.4
"""Metres, edge of the voxels in which places are compared, as surfels have."""
BODY_SHARE = 0.8
"""Share of the scans that must see it at the same place."""
BODY_SPREAD = 0.04
"""Metres, deviation of that place: noise of a surfel."""

Array = npt.NDArray[np.float64]


def signed_distance(T_start_end: Pose, forward: Array) -> tuple[Array, Array]:
    """Return (...,) metres travelled, negative backwards, and the (..., 3) direction that is forwards."""
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
    """Return how much surface facing along the path is found again, had the sensor travelled `distances` (D,) metres.

    Returned as (3, D): of what may be vehicles that keep pace, of what is too far beside the path for these, and of
    what is higher than any, `overhead` metres over the sensor. The surfels' own compensation follows: `per_sweep` is
    the share of the distance that is driven during a sweep.
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
    """Return the surfels of consecutive scans, each in its sensor frame, less those of the vehicle's own body.

    Near the sensor, what nearly every scan has at the same place to within centimetres belongs to the vehicle (or is
    ground so even that nothing is lost with it). While the vehicle stands, everything does.
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


def stands(refound: Array, whole: Array) -> bool:
    """Return whether as much is found again where it was, of the `whole` (3,), as one at rest sees.

    What is high tells, if there is any; what is lower may be traffic nearly all.
    """
    if whole[2] > EVIDENCE:
        return bool(refound[2] > STANDSTILL_SHARE * whole[2])
    return bool(refound.sum() > STANDSTILL_SHARE_LOW * whole.sum())


def expected_share(distances: Array) -> Array:
    """Return how much of what faces along the path is found again at least, (D,), had the sensor travelled `distances`.

    From nearly the same place nearly all of it is: what stands with the traffic finds little beside the traffic.
    """
    return NEAR_SHARE * np.exp(-np.abs(distances) / NEAR_VIEW)


@kernel
def _score(  # type: ignore[no-untyped-def]
    submap, points, covariance, times, R, offset, direction, distances, shift, overhead, scores
):  # fmt: skip
    keys, rows, mean, axes, variance = submap
    inverse_voxel = 1.0 / VOXEL
    says = np.zeros(len(mean))  # how much each voxel says about the path
    for row in range(len(mean)):
        for k in range(2):
            if variance[row, k] < 0.0:
                break
            says[row] += (
                axes[row, k, 0] * direction[0] + axes[row, k, 1] * direction[1] + axes[row, k, 2] * direction[2]
            ) ** 2
    n_telling = 0
    for slot in range(len(keys)):
        if keys[slot] != -1 and says[rows[slot]] > 0.1:
            n_telling += 1
    size = 16
    while size < 4 * n_telling:
        size *= 2
    few_keys, few_rows = np.full(size, -1, np.int64), np.zeros(size, np.int32)  # small enough to stay in cache
    for slot in range(len(keys)):
        if keys[slot] != -1 and says[rows[slot]] > 0.1:
            few = find_slot(few_keys, keys[slot])
            few_keys[few] = keys[slot]
            few_rows[few] = rows[slot]
    a = np.empty(3)
    for k in range(3):  # the path in the surfels' frame
        a[k] = R[0, k] * direction[0] + R[1, k] * direction[1] + R[2, k] * direction[2]
    for i in range(len(points)):
        c = covariance[i]
        if variance_along(c, a) > 0.2 * (c[0] + c[3] + c[5]):  # it lies along the path
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
                scores[where, d] += says[row]
