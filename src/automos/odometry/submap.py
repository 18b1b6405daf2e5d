"""A short window of the recording as a map of small planes and edges, and the alignment of a scan with it.

Surfels of a few neighbouring scans are merged in voxels. A voxel with a plane gives the residual of a surfel along the
normal; one with an upright edge or pole, along both directions perpendicular to it. A single ring of a spinning sensor
looks like a horizontal line and is ignored, since the ring moves with the sensor and would bias every registration
towards standstill.
"""

from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dsygvd

from automos.core.cells import moved
from automos.core.covariances import across, eigenvalues, eigenvector, variance_along
from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import MIN_RANGE, Points, Pose
from automos.core.voxels import find_slot
from automos.odometry.surfels import SURFEL, Surfels, key_at_level, level_of

NOISE = 0.03
"""Metres, deviation of a surfel on a perfect surface: range noise of usual sensors."""
CLOSE = 0.1
"""Metres between a surface and its inliers, at most: three deviations."""
MAX_WEIGHT = 8.0
"""Greatest weight of a surfel, in points, when surfels are merged: near surfaces have hundreds, far ones a few."""

THIN = 0.1
"""Share of the next greater variance that the least of a plane has at most, and the middle one of an edge."""


class Submap(NamedTuple):
    """Voxels in the frame of the submap's middle scan."""

    keys: npt.NDArray[np.int64]  # (K,) open hash table of voxel keys, -1 if empty
    rows: npt.NDArray[np.int32]  # (K,) row of each key in the arrays below
    mean: Points  # (M, 3) metres
    axes: npt.NDArray[np.float32]  # (M, 2, 3) normals: an edge has two, a plane one and where that may turn to (rad)
    variance: npt.NDArray[np.float32]  # (M, 2) square metres along these; negative for an unused direction


class Fit(NamedTuple):
    """Fit of surfels to a submap, to second order in a small motion (translation, rotation) of the submap's frame.

    On demand, also in the elevation of all beams, those of the submap included: the seventh unknown, radians.
    """

    H: Array  # (6, 6)
    g: Array  # (6,); moving the surfels by -inv(H) @ g in the submap's frame aligns them best
    n_surfels: int
    n_matched: int  # surfels matched to a surface
    n_close: int  # surfels within `CLOSE` of it
    thickness: float  # metres, robust root mean square distance from the surfaces

    def moved(self, change: Array) -> Self:
        """Return the fit after a small motion `change` (6,) of the surfels in the submap's frame, to first order."""
        return self._replace(g=self.g + self.H[:, :6] @ change)


def make_submap(parts: list[Surfels], T_center_parts: Pose) -> Submap:
    """Return the merged surfels of P scans `parts`, each moved by its (4, 4) of `T_center_parts` (P, 4, 4)."""
    n = sum(len(part) for part in parts)
    size = 1 << max(n, 16).bit_length()  # at least one slot stays empty, since a search ends at an empty slot
    keys, rows = np.full(size, -1, np.int64), np.zeros(size, np.int32)
    sums, m = np.empty((n, 10)), 0
    for part, T in zip(parts, T_center_parts, strict=True):
        # contiguous, so that the kernel is compiled only once
        mean, covariance, count, T = (np.ascontiguousarray(one) for one in (part.mean, part.covariance, part.count, T))
        m = _add_surfels(mean, covariance, count, T, keys, rows, sums, m)
    mean, axes, variance = _shape_voxels(sums[:m])
    return Submap(keys, rows, mean, axes, variance)


def fit_surfels(
    submap: Submap,
    surfels: Surfels,
    T_submap_surfels: Pose,
    kernel: float,
    noise: float = NOISE,
    with_elevation: bool = False,
) -> Fit:
    """Return the fit of `surfels`, moved by `T_submap_surfels`, to `submap`.

    Parameters
    ----------
    submap : Submap
    surfels : Surfels, in their own frame.
    T_submap_surfels : (4, 4) float64.
    kernel : float, metres; much larger residuals have little weight (Geman and McClure).
    noise : float, metres, deviation of a surfel on a perfect surface.

    Equation: surface
    """
    n = 7 if with_elevation else 6
    H, g, noise_of_H = np.zeros((n, n)), np.zeros(n), np.zeros((n, n))
    T = np.ascontiguousarray(T_submap_surfels, np.float64)
    mean, covariance = np.ascontiguousarray(surfels.mean), np.ascontiguousarray(surfels.covariance)
    n_matched, n_close, thickness = _fit(submap, mean, covariance, T, (kernel, noise), H, g, noise_of_H)
    return Fit(*_beyond_noise(H + np.tril(H, -1).T, g, noise_of_H), len(surfels), n_matched, n_close, thickness)


def _beyond_noise(H: Array, g: Array, noise: Array) -> tuple[Array, Array]:
    """Return `H` and `g` with each direction weighed down by the share of its information that is noise of normals."""
    if not np.isfinite(H + noise).all():  # of points beyond any sensor's range
        return H, g
    # Of normals that are off by some degrees, planes seem to hold along themselves, too: where beams hit them before.
    share, V, has_failed = dsygvd(noise, H + (1e-9 * np.trace(H) + 1e-9) * np.eye(len(H)), uplo="L")  # V^T H V = 1
    if has_failed:
        return H, g
    kept = H @ V * np.clip(1.0 - share, 0.0, 1.0)
    return kept @ (H @ V).T, kept @ (V.T @ g)


@kernel
def voxel_of(x, y, z):  # type: ignore[no-untyped-def]
    """Return the int64 key of the voxel at a position: two surfels wide, to contain a plane."""
    return key_at_level(x, y, z, level_of(x, y, z), 0.5 / SURFEL)


@kernel
def _add_surfels(mean, covariance, count, T, keys, rows, sums, m):  # type: ignore[no-untyped-def]
    """Add weighted moments (1, mean, mean mean^T + covariance) to each voxel; `sums` is empty from row `m` on.

    Turned without loops, which takes half the time.
    """
    r00, r01, r02 = T[0, 0], T[0, 1], T[0, 2]
    r10, r11, r12 = T[1, 0], T[1, 1], T[1, 2]
    r20, r21, r22 = T[2, 0], T[2, 1], T[2, 2]
    for i in range(len(mean)):
        x, y, z = moved(T, float(mean[i, 0]), float(mean[i, 1]), float(mean[i, 2]))
        key = voxel_of(x, y, z)
        slot = find_slot(keys, key)
        if keys[slot] == -1:
            keys[slot], rows[slot] = key, m
            sums[m] = 0.0
            m += 1
        row, w = sums[rows[slot]], min(float(count[i]), MAX_WEIGHT)
        xx, xy, xz, yy, yz, zz = covariance[i]
        # R C, row by row, then R C R^T
        ax, ay, az = r00 * xx + r01 * xy + r02 * xz, r00 * xy + r01 * yy + r02 * yz, r00 * xz + r01 * yz + r02 * zz
        bx, by, bz = r10 * xx + r11 * xy + r12 * xz, r10 * xy + r11 * yy + r12 * yz, r10 * xz + r11 * yz + r12 * zz
        cx, cy, cz = r20 * xx + r21 * xy + r22 * xz, r20 * xy + r21 * yy + r22 * yz, r20 * xz + r21 * yz + r22 * zz
        xx, xy, xz = ax * r00 + ay * r01 + az * r02, ax * r10 + ay * r11 + az * r12, ax * r20 + ay * r21 + az * r22
        yy, yz, zz = bx * r10 + by * r11 + bz * r12, bx * r20 + by * r21 + bz * r22, cx * r20 + cy * r21 + cz * r22
        moments = (1.0, x, y, z, x * x + xx, x * y + xy, x * z + xz, y * y + yy, y * z + yz, z * z + zz)
        for k in range(len(moments)):
            row[k] += w * moments[k]
    return m


@kernel
def _shape_voxels(sums):  # type: ignore[no-untyped-def]
    """Return mean, axes and variance (see `Submap`) of each voxel from its (M, 10) `sums`."""
    n = len(sums)
    mean = np.empty((n, 3), np.float32)
    axes = np.zeros((n, 2, 3), np.float32)
    variance = np.full((n, 2), -1.0, np.float32)
    c, along, first, second = np.empty(6), np.empty(3), np.zeros(3), np.zeros(3)
    for i in range(n):
        row = sums[i]
        w = 1.0 / row[0]
        x, y, z = row[1] * w, row[2] * w, row[3] * w
        mean[i, 0], mean[i, 1], mean[i, 2] = x, y, z
        if row[0] < 6.0:
            continue
        c[0], c[1], c[2] = row[4] * w - x * x, row[5] * w - x * y, row[6] * w - x * z
        c[3], c[4], c[5] = row[7] * w - y * y, row[8] * w - y * z, row[9] * w - z * z
        low, middle, high = eigenvalues(c)
        wide = (0.12 * 2.0 * SURFEL * (1 << level_of(x, y, z))) ** 2
        turn = 1.0
        if middle > wide:
            if low < THIN * middle:  # a plane
                eigenvector(c, low, first)
                eigenvector(c, middle, second)
                variance[i, 0] = low
                turn = np.sqrt((low + NOISE * NOISE) / (row[0] * middle))
        elif high > wide and middle < THIN * high:
            eigenvector(c, high, along)
            if abs(along[2]) > 0.8:  # an upright edge
                variance[i, 0], variance[i, 1] = across(c, along, first, second)
        for k in range(3):  # assigning one array to another takes three seconds to compile
            axes[i, 0, k], axes[i, 1, k] = first[k], turn * second[k]
    return mean, axes, variance


@kernel
def _rise(nx, ny, nz, p):  # type: ignore[no-untyped-def]
    """Return the metres along the direction n that a point `p` moves for each radian that its beam points higher."""
    x, y, z = float(p[0]), float(p[1]), float(p[2])
    level = np.sqrt(x * x + y * y)
    return nz * level - z * (nx * x + ny * y) / max(level, MIN_RANGE)


@kernel
def _add_square(J, w, H):  # type: ignore[no-untyped-def]
    """Add w J J^T to the lower triangle of `H`."""
    for p in range(len(H)):
        for q in range(p + 1):
            H[p, q] += w * J[p] * J[q]


@kernel
def _fit(submap, points, covariance, T, limits, H, g, noise_of_H):  # type: ignore[no-untyped-def]
    """Add to `g` and the lower triangles of `H` and its noise; return matched and close surfels, and the thickness."""
    (keys, rows, mean, axes, variance), (kernel, noise) = submap, limits
    n_matched, n_close, squares, weights = 0, 0, 0.0, 0.0
    R, n = T[:3, :3], len(g)
    J, a = np.empty(7), np.empty(3)
    for i in range(len(points)):
        x, y, z = moved(T, float(points[i, 0]), float(points[i, 1]), float(points[i, 2]))
        slot = find_slot(keys, voxel_of(x, y, z))
        row = rows[slot]
        if keys[slot] == -1 or variance[row, 0] < 0.0:
            continue
        dx, dy, dz = x - mean[row, 0], y - mean[row, 1], z - mean[row, 2]
        worst = w = 0.0
        for k in range(2):
            nx, ny, nz = float(axes[row, k, 0]), float(axes[row, k, 1]), float(axes[row, k, 2])
            for j in range(3):  # the direction in the surfel's frame
                a[j] = R[0, j] * nx + R[1, j] * ny + R[2, j] * nz
            J[0], J[1], J[2] = nx, ny, nz
            J[3], J[4], J[5] = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
            if n == 7:
                J[6] = _rise(a[0], a[1], a[2], points[i]) - _rise(nx, ny, nz, mean[row])
            if variance[row, k] < 0.0:  # where a plane's normal may turn to
                _add_square(J, w, noise_of_H)
                break
            r = nx * dx + ny * dy + nz * dz
            robust = kernel * kernel / (kernel * kernel + r * r)
            w = robust * robust / (variance[row, k] + variance_along(covariance[i], a) + noise * noise)
            _add_square(J, w, H)
            for p in range(n):
                g[p] += w * r * J[p]
            worst = max(worst, abs(r))
            trust = 4.0 * CLOSE * CLOSE / (4.0 * CLOSE * CLOSE + r * r)  # independent of the kernel
            squares += trust * trust * r * r
            weights += trust * trust
        n_matched += 1
        n_close += worst < CLOSE
    return n_matched, n_close, np.sqrt(squares / max(weights, 1e-12))
