"""The vertical and the height of the sensor, from the ground near it, for any mounting orientation.

In a few scans spread over the recording, the ground is the plane near the sensor that contains most of the observed
surface and has almost nothing behind it. It lies below the sensor, or above if the sensor is mounted upside down.
"""

from __future__ import annotations

import logging

import numpy as np

from automos.core.geometry import Array, make_transform, rotation_between
from automos.core.kernels import kernel
from automos.core.scan import Points, Pose
from automos.core.voxels import find_slot, voxel_key
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

RANGE = 20.0
"""Metres around the sensor in which the ground is searched: farther away, its slope may differ."""
VOXEL = 0.5
"""Metres; one point per voxel is used, so that all surfaces have equal weight."""
TRIALS = 1000
"""Planes through three points that are tried: if a fifth of the surface is ground, eight of them lie on it."""
DISTANCE = 0.15
"""Metres between a plane and its inliers, at most: allows for kerbs and ruts."""
SHARE = 0.1
"""Least share of the near surface that must be ground."""
MIN_POINTS = 50
"""Points that a plane needs, and so a scan in which the ground is searched."""


def level_frame(clouds: list[Points], poses: Pose, settings: OdometrySettings) -> tuple[Pose, bool]:
    """Return `T_level_world` and whether ground was found (else the identity).

    Parameters
    ----------
    clouds : list of M arrays (n, 3) float32, metres, sensor frame; the first is the recording's first usable scan.
    poses : (M, 4, 4) their T_world_sensor.
    settings : OdometrySettings
    """
    near = [_thin(cloud) for cloud in clouds]
    everything = np.concatenate(near) if near else np.zeros((0, 3))
    mount = _find_plane(everything, settings)  # common to most scans: the mounting of the sensor
    if mount is None:
        return np.eye(4), False
    planes = [_fit_plane(points, mount) for points in near]
    ups = np.array([T[:3, :3] @ plane[:3] for T, plane in zip(poses, planes, strict=True)])
    up = np.median(ups, axis=0)
    R = rotation_between(up / np.linalg.norm(up), [0.0, 0.0, 1.0])
    # Height of the ground under the first scan, along the common vertical.
    normal, offset = planes[0][:3], planes[0][3]
    down = poses[0][:3, :3].T @ (-up / np.linalg.norm(up))
    height = offset / max(-float(down @ normal), 0.5)
    T = make_transform(R)
    T[2, 3] = height - (R @ poses[0][:3, 3])[2]
    return T, True


def _thin(points: Points) -> Array:
    """Return one point per voxel near the sensor, so that all surfaces have equal weight."""
    keys, rows = _nearest_to_middle(points, RANGE, VOXEL, 1 << max(2 * len(points), 8).bit_length())
    return points[rows[np.argsort(keys)]].astype(np.float64)  # independent of the input order


@kernel
def _nearest_to_middle(points, reach, voxel, size):  # type: ignore[no-untyped-def]
    """Return the keys of voxels, and the row of the point nearest to the centre of each."""
    keys, found = np.full(size, -1, np.int64), np.zeros(size, np.int32)
    best = np.full(size, np.inf)
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        if not x * x + y * y + z * z < reach * reach:
            continue
        key = voxel_key(x, y, z, 1.0 / voxel)
        slot = find_slot(keys, key)
        off = 0.0
        for c in (x / voxel, y / voxel, z / voxel):
            off += (c - np.floor(c) - 0.5) ** 2
        if off < best[slot]:
            keys[slot], found[slot], best[slot] = key, i, off
    used = keys != -1
    return keys[used], found[used]


def _find_plane(points: Array, settings: OdometrySettings) -> Array | None:
    """Return (4,) unit normal towards the sensor and its height above the plane, or None if there is no ground."""
    if len(points) < MIN_POINTS:
        return None
    rng = np.random.default_rng(0)
    triples = rng.integers(0, len(points), (TRIALS, 3))
    points_tested = points[rng.permutation(len(points))[:5000]]
    a, b, c = points[triples[:, 0]], points[triples[:, 1]], points[triples[:, 2]]
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    is_plane = length > 1e-6
    normals, a = normals[is_plane] / length[is_plane, None], a[is_plane]
    heights = -np.einsum("ij,ij->i", normals, a)  # of the sensor above each plane
    normals *= np.sign(heights)[:, None]
    heights = np.abs(heights)
    is_possible = (
        (np.abs(normals[:, 2]) > np.cos(np.radians(settings.max_tilt_deg)))
        & (heights > settings.min_height)
        & (heights < settings.max_height)
    )
    if not is_possible.any():
        return None
    normals, heights = normals[is_possible], heights[is_possible]
    scores = _score_planes(points_tested, normals, heights, DISTANCE)
    best = int(np.argmax(scores))
    if scores[best] < SHARE * len(points_tested):
        return None
    return _fit_plane(points, np.append(normals[best], heights[best]))


@kernel
def _score_planes(points, normals, heights, distance):  # type: ignore[no-untyped-def]
    """Return inliers of each plane minus twice the points clearly behind it (roofs have some, valley walls none)."""
    scores = np.zeros(len(normals))
    for j in range(len(normals)):
        score = 0.0
        for i in range(len(points)):
            d = heights[j]
            for k in range(3):
                d += normals[j, k] * points[i, k]
            if abs(d) < distance:
                score += 1.0
            elif d < -3.0 * distance:
                score -= 2.0
        scores[j] = score
    return scores


def _fit_plane(points: Array, plane: Array) -> Array:
    """Return `plane` (4,) fitted to the points near it, with a decreasing distance (reweighted least squares)."""
    for reach in (4.0, 2.0, 1.0, 1.0):
        residual = points @ plane[:3] + plane[3]
        near = points[np.abs(residual) < reach * DISTANCE]
        if len(near) < MIN_POINTS:
            return plane
        centre = near.mean(axis=0)
        _, vectors = np.linalg.eigh(np.cov((near - centre).T))
        normal = vectors[:, 0] * np.sign(vectors[:, 0] @ plane[:3])
        if normal @ plane[:3] < 0.9:
            return plane
        plane = np.append(normal, -normal @ centre)
    return plane
