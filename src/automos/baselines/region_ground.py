"""The ground of one bin of a map: ERASOR's region-wise plane fit (R-GPF).

A bin is a few metres wide, so a plane fits its ground, unlike that of the whole scene.
"""

import numpy as np

from automos.core.kernels import kernel


@kernel
def fit_region_ground(points, seed_height, n_skipped, n_lowest, n_iterations, distance):  # type: ignore[no-untyped-def]
    """Return (N,) bool: which of one bin's `points` (N, 3, z up) are ground, by region-wise plane fit (R-GPF).

    The first seeds are the points less than `seed_height` above the mean height of the `n_lowest` lowest points after
    the `n_skipped` very lowest. Then a plane is fitted `n_iterations` times; the next seeds are the points nearer than
    `distance` to it or below it. The normal is oriented upwards; its sign is arbitrary in the released code.
    """
    n = len(points)
    is_ground = np.zeros(n, np.bool_)
    order = np.argsort(points[:, 2])
    skipped = min(n_skipped, max(n - 1, 0))
    last = min(skipped + n_lowest, n)
    lowest = 0.0
    for k in range(skipped, last):
        lowest += points[order[k], 2]
    lowest /= last - skipped
    for i in range(n):
        is_ground[i] = points[i, 2] < lowest + seed_height
    for _ in range(n_iterations):
        m = 0
        mean = np.zeros(3)
        for i in range(n):
            if is_ground[i]:
                m += 1
                for a in range(3):
                    mean[a] += points[i, a]
        if m < 3:
            break
        mean /= m
        covariance = np.zeros((3, 3))
        for i in range(n):
            if is_ground[i]:
                for a in range(3):
                    for c in range(3):
                        covariance[a, c] += (points[i, a] - mean[a]) * (points[i, c] - mean[c])
        if not np.isfinite(covariance).all():
            break
        normal = np.linalg.eigh(covariance)[1][:, 0]
        if normal[2] < 0.0:
            normal = -normal
        for i in range(n):
            height = 0.0
            for a in range(3):
                height += normal[a] * (points[i, a] - mean[a])
            is_ground[i] = height < distance
    return is_ground
