"""The vertical and the height of the sensor, from the ground near it, for any mounting orientation.

The ground is the plane near the sensor, below it, on which most of the surface around lies, and which has almost
nothing behind it. Walls pass through a plane; only what lies in it speaks for it. Most sensors stand upright or nearly
so: another plane must be much better, such as the road above a sensor that hangs. A floor and a ceiling are told apart
by what stands on them. Where nothing lies, no ground is claimed, and the sensor's own z axis is the vertical.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.covariances import variance_along
from automos.core.geometry import Array, inverse, make_transform, rotation_between, transform
from automos.core.kernels import kernel
from automos.core.scan import Points, Pose
from automos.odometry.motion import MIN_POINTS
from automos.odometry.submap import CLOSE, NOISE
from automos.odometry.surfels import NEAR
from automos.settings import OdometrySettings

Shapes = tuple[Points, npt.NDArray[np.float32]]
"""Of the surfels of a scan: means (n, 3), metres, and covariances (n, 6), xx, xy, xz, yy, yz, zz."""

TRIALS = 1000
"""Planes through three surfels that are tried: if a fifth of the surface is ground, eight of them lie on it."""
STANDING = 1.0
"""Metres above a plane in which things stand on it."""
SHARE = 0.1
"""Least share of the near surface that must be ground."""
UPRIGHT_DEG = 25.0
"""Degrees, usual tilt of a sensor at most, and of the ground to the plane that it is found with."""
UNUSUAL = 0.5
"""Prior of every other orientation, relative to an upright one."""


class Level(NamedTuple):
    """The vertical and the ground under the first scan."""

    T_level_world: Pose  # (4, 4) float64; the identity if no ground was found
    has_ground: bool
    is_doubtful: bool  # whether only the prior speaks against another vertical


def level_frame(scans: list[Shapes], poses: Pose, settings: OdometrySettings) -> Level:
    """Return the level frame of a recording, from what is near the sensor: farther away, the slope may differ.

    Parameters
    ----------
    scans : M pairs of the means and covariances of surfels, sensor frame; the first is the first usable scan's.
    poses : (M, 4, 4) their T_world_sensor.
    settings : OdometrySettings
    """
    rows = [np.einsum("ij,ij->i", mean, mean) < NEAR * NEAR for mean, _ in scans]
    near = [(mean[keep], covariance[keep]) for (mean, covariance), keep in zip(scans, rows, strict=True)]
    if sum(len(mean) for mean, _ in near) < MIN_POINTS:
        return Level(np.eye(4), False, False)
    mean, covariance = (np.concatenate(part).astype(np.float64) for part in zip(*near, strict=True))
    mount, is_doubtful = _find_plane(mean, covariance, settings)  # common to most scans: the mounting of the sensor
    if mount is None and len(near) > 1:  # carried by hand: what the first scan would have seen of all
        return level_frame([_as_seen_first(near, poses)], poses[:1], settings)
    if mount is None:
        return Level(np.eye(4), False, is_doubtful)
    # rounded, so that the order of summation does not show
    planes = [np.round(_fit_plane(mean.astype(np.float64), around, mount), 9) for mean, around in near]
    ups = np.array([T[:3, :3] @ plane[:3] for T, plane in zip(poses, planes, strict=True)])
    up = np.median(ups, axis=0)
    R = rotation_between(up / np.linalg.norm(up), [0.0, 0.0, 1.0])
    # Height of the ground under the first scan, along the common vertical.
    down = poses[0][:3, :3].T @ (-up / np.linalg.norm(up))
    height = planes[0][3] / max(-float(down @ planes[0][:3]), 0.5)
    return Level(make_transform(R, [0.0, 0.0, height - (R @ poses[0][:3, 3])[2]]), True, is_doubtful)


def _as_seen_first(scans: list[Shapes], poses: Pose) -> Shapes:
    """Return all surfels in the frame of the first scan."""
    means, covariances = [], []
    for (mean, c), T in zip(scans, inverse(poses[0]) @ poses, strict=True):
        turned = T[:3, :3] @ c[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]] @ T[:3, :3].T
        means.append(transform(T, mean))
        covariances.append(turned[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])
    return np.concatenate(means), np.concatenate(covariances)


def _find_plane(points: Array, covariance: Array, settings: OdometrySettings) -> tuple[Array | None, bool]:
    """Return (4,) unit normal towards the sensor and its height above the plane, None if there is no ground.

    Also whether a plane of unusual orientation is as good: only the prior decides then.
    """
    rng = np.random.default_rng(0)
    a, b, c = points[rng.integers(0, len(points), (TRIALS, 3)).T]
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    is_plane = length > 1e-6
    normals, a = normals[is_plane] / length[is_plane, None], a[is_plane]
    heights = -np.einsum("ij,ij->i", normals, a)  # of the sensor above each plane
    normals *= np.sign(heights)[:, None]
    heights = np.abs(heights)
    is_in_tilt = np.abs(normals[:, 2]) > np.cos(np.radians(settings.max_tilt_deg))
    is_possible = is_in_tilt & (heights > settings.min_height) & (heights < settings.max_height)
    normals, heights = normals[is_possible], heights[is_possible]
    lying, standing = _score_planes(points, covariance, normals, heights)
    is_upright = normals[:, 2] > np.cos(np.radians(UPRIGHT_DEG))
    prior = np.where(is_upright, 1.0, UNUSUAL)
    best = [max(rows, key=lying.__getitem__) for k in (True, False) if len(rows := np.flatnonzero(is_upright == k))]
    best = [k for k in best if prior[k] * lying[k] >= SHARE * len(points)]
    if not best:
        return None, False
    score = lying + standing
    chosen = max(best, key=(prior * score).__getitem__)
    is_doubtful = bool(is_upright[chosen] and score[best[-1]] > score[chosen])
    return _fit_plane(points, covariance, np.append(normals[chosen], heights[chosen])), is_doubtful


@kernel
def _score_planes(points, covariance, normals, heights):  # type: ignore[no-untyped-def]
    """Return the surfels that lie in each plane minus twice those clearly behind it, and those that stand on it.

    Roofs have some behind them, valley walls none.
    """
    lying, standing = np.zeros(len(normals)), np.zeros(len(normals))
    for j in range(len(normals)):
        normal = normals[j, 0], normals[j, 1], normals[j, 2]  # numbers: a row of an array would be counted who holds it
        for i in range(len(points)):
            d = heights[j] + normal[0] * points[i, 0] + normal[1] * points[i, 1] + normal[2] * points[i, 2]
            if d < -3.0 * CLOSE:
                lying[j] -= 2.0
            elif abs(d) < STANDING:
                c = covariance[i]
                is_flat = variance_along((c[0], c[1], c[2], c[3], c[4], c[5]), normal) < NOISE * NOISE
                if is_flat and abs(d) < CLOSE:
                    lying[j] += 1.0
                elif d > 0.0 and not is_flat:
                    standing[j] += 1.0
    return lying, standing


def _fit_plane(points: Array, covariance: Array, plane: Array) -> Array:
    """Return `plane` (4,) fitted to what lies near it, with a decreasing distance (reweighted least squares)."""
    normal = plane[:3]
    spread = covariance @ (normal[[0, 0, 0, 1, 1, 2]] * normal[[0, 1, 2, 1, 2, 2]] * [1.0, 2.0, 2.0, 1.0, 2.0, 1.0])
    lying = points[spread < NOISE * NOISE]
    for reach in (4.0, 2.0, 1.0, 1.0):
        residual = lying @ plane[:3] + plane[3]
        near = lying[np.abs(residual) < reach * CLOSE]
        if len(near) < MIN_POINTS:
            return plane
        centre = near.mean(axis=0)
        _, vectors = np.linalg.eigh(np.cov((near - centre).T))
        normal = vectors[:, 0] * np.sign(vectors[:, 0] @ plane[:3])
        if normal @ plane[:3] < np.cos(np.radians(UPRIGHT_DEG)):
            return plane
        plane = np.append(normal, -normal @ centre)
    return plane
