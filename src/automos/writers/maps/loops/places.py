"""Descriptors of places from above, which are recognised from any heading.

The heights of surrounding objects, in rings and sectors about the place (Scan Context: Kim and Kim, IROS 2018), from
several scans, so that they do not depend on the sensor's beams. A rotation in place shifts the sectors.
"""

from __future__ import annotations

import numpy as np

from automos.core.geometry import Array
from automos.core.scan import Points

GROUND = 0.5
"""Metres above the lowest surface below which heights are not distinctive."""


def describe_place(points: Points, reach: float, rings: int, sectors: int) -> Array:
    """Return (rings, sectors) metres, the heights of objects above the ground around the place; 0 if there are none.

    Parameters
    ----------
    points : (N, 3) float, metres, z up, the place at the origin.
    reach : float, metres, outer radius.
    """
    x, y, z = np.asarray(points, np.float64).T
    distance = np.hypot(x, y)
    is_near = distance < reach
    if not is_near.any():
        return np.zeros((rings, sectors))
    ring = (distance[is_near] * (rings / reach)).astype(int)
    angle = np.arctan2(y[is_near], x[is_near]) / (2.0 * np.pi) % 1.0
    sector = np.minimum((angle * sectors).astype(int), sectors - 1)
    highest = np.full(rings * sectors, -np.inf)
    np.maximum.at(highest, ring * sectors + sector, z[is_near])
    height = highest - ground_of(z[is_near])
    return np.where(height > GROUND, height, 0.0).reshape(rings, sectors)


def ground_of(z: np.ndarray) -> float:
    """Return the height of the ground among those of points, `z` (N,), metres: hardly any are below it."""
    return float(np.percentile(z, 5.0))


def compare_places(a: Array, b: Array) -> tuple[float, float]:
    """Return the difference of two places (rings, sectors), 0 to 1, and the rotation (rad) of `b`.

    The rotation is the heading of b's frame in a's. The difference is one minus the mean cosine between sectors, at the
    shift that minimises it; sectors empty in both are ignored.
    """
    length_a, length_b = np.linalg.norm(a, axis=0), np.linalg.norm(b, axis=0)
    unit_a, unit_b = a / np.maximum(length_a, 1e-9), b / np.maximum(length_b, 1e-9)
    n = a.shape[1]
    sector = np.arange(n)
    turned = (sector - sector[:, None]) % n  # (shift, sector of a) -> sector of b
    cosine = (unit_a.T @ unit_b)[sector, turned]
    is_seen = (length_a > 0.0) | (length_b[turned] > 0.0)
    n_seen = is_seen.sum(axis=1)
    difference = 1.0 - cosine.sum(axis=1) / np.maximum(n_seen, 1)
    shift = int(np.argmin(difference))
    return float(difference[shift]), 2.0 * np.pi * shift / n
