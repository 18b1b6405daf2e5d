"""The vehicle's own body in its scans: what looks the same from the sensor all along says nothing about its motion."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.odometry.surfels import Surfels

RANGE = 6.0
"""Metres within which the vehicle's own body is looked for: a long one's ends."""
VOXEL = 0.4
"""Metres, edge of the voxels in which places are compared, as surfels have."""
SHARE = 0.8
"""Share of the scans that must see it at the same place."""
SPREAD = 0.04
"""Metres, deviation of that place: noise of a surfel."""


def without_body(surfels: list[Surfels]) -> list[Surfels]:
    """Return the surfels of consecutive scans, each in its sensor frame, less those of the vehicle's own body.

    Near the sensor, what nearly every scan has at the same place to within centimetres belongs to the vehicle (or is
    ground so even that nothing is lost with it). While the vehicle stands, everything does.
    """
    if not surfels:
        return []
    is_near = [np.einsum("ij,ij->i", s.mean, s.mean) < RANGE**2 for s in surfels]
    means = np.concatenate([s.mean[near] for s, near in zip(surfels, is_near, strict=True)]).astype(np.float64)
    _, voxel, count = np.unique(_voxel_keys(means), return_inverse=True, return_counts=True)
    spread = np.zeros(len(count))
    for axis in range(3):
        mean = np.bincount(voxel, means[:, axis], len(count)) / count
        spread += np.bincount(voxel, (means[:, axis] - mean[voxel]) ** 2, len(count)) / count
    is_body = ((count > SHARE * len(surfels)) & (spread < SPREAD**2))[voxel]
    out = []
    for scan, near in zip(surfels, is_near, strict=True):
        keep = np.ones(len(scan), bool)
        n = int(near.sum())
        keep[near] = ~is_body[:n]
        is_body = is_body[n:]
        out.append(scan[keep])
    return out


def _voxel_keys(points: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    k = np.floor(points / VOXEL).astype(np.int64) + (1 << 20)
    return (k[:, 0] << 42) | (k[:, 1] << 21) | k[:, 2]
