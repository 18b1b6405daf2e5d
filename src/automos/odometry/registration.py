"""Registration of a scan to the points of previous ones: KISS-ICP (Vizzo et al., RA-L 2023), compiled.

Robust point-to-point ICP on a map of voxels with a few points each; the correspondence distance adapts to the errors of
previous predictions. It is several times as fast as the authors' library, with the same poses, for two reasons: a
nearest-neighbour search skips voxels farther away than the best point so far, and a correspondence is only searched
again once the point has moved far enough for another point to be nearer.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import Points, Pose
from automos.core.voxels import ALONG_X, ALONG_Y, ALONG_Z, find_slot, rows_of_first_in_voxel, voxel_key

DENSE, SPARSE = 0.5, 1.5
"""Downsampling of scans, in voxels of the map, for the map and for registration (the authors' values)."""
MIN_MOTION = 0.1
"""Metres; smaller prediction errors do not change the correspondence distance (the authors' value)."""
FORGET_EVERY = 0.1
"""Share of the map's range that the sensor travels before points out of range are removed."""
MAX_ITERATIONS, CONVERGENCE = 500, 1e-4
"""Iterations of a registration, and metres of a step below which it ends (the authors' values)."""
AROUND = np.array(sorted(np.ndindex(3, 3, 3), key=lambda v: np.abs(np.array(v) - 1).sum())) - 1
"""A voxel and its neighbours, nearest first."""


class LocalMap:
    """Points around the sensor in voxels of `voxel` metres, each with `capacity` points at most."""

    def __init__(self, voxel: float, capacity: int, max_range: float):
        """Take the map's parameters (range in metres); the map is empty at first."""
        self.voxel, self.max_range = voxel, max_range
        self._center = np.zeros(3)
        self._keys, self._rows = np.full(1 << 12, -1, np.int64), np.zeros(1 << 12, np.int32)
        self._cells, self._counts = np.empty((1 << 10, capacity, 3)), np.zeros(1 << 10, np.int32)
        self._n = 0

    @property
    def arrays(self) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray, npt.NDArray, float]:
        """Arguments of the compiled loops: voxel keys and their rows, points and their number by row, voxel edge."""
        return self._keys, self._rows, self._cells, self._counts, self.voxel

    def add(self, points: Array, center: Array) -> None:
        """Add `points` (M, 3), world frame, observed from `center`, except those too near to others."""
        is_far = np.linalg.norm(center - self._center) > FORGET_EVERY * self.max_range
        if is_far or 2 * (self._n + len(points)) > min(len(self._keys), 2 * len(self._cells)):
            self._center = center
            self._rebuild(len(points))
        self._n = _add_points(points, self.arrays, self._n)

    def _rebuild(self, n_more: int) -> None:
        """Remove voxels out of range, and reserve space for `n_more` voxels."""
        first = self._cells[: self._n, 0] - self._center
        kept = np.flatnonzero(np.einsum("ij,ij->i", first, first) < self.max_range**2)
        n, room = len(kept), 2 * (len(kept) + n_more)
        cells, counts = np.empty((room, *self._cells.shape[1:])), np.zeros(room, np.int32)
        cells[:n], counts[:n] = self._cells[kept], self._counts[kept]
        size = 1 << (2 * room).bit_length()
        self._keys, self._rows = np.full(size, -1, np.int64), np.zeros(size, np.int32)
        self._cells, self._counts, self._n = cells, counts, n
        _enter(np.ascontiguousarray(cells[:n, 0]), self._keys, self._rows, self.voxel)


class Icp:
    """Registers scans to the map of the previous ones and tracks the errors of predictions."""

    def __init__(self, local_map: LocalMap, threshold: float):
        """Take the map, and the initial expected deviation from predictions (m)."""
        self._map = local_map
        self._squares, self._n = threshold**2, 1

    def register(self, points: Points, T_world_predicted: Pose) -> Pose:
        """Return the pose of the scan `points` (M, 3), starting from its prediction, and add it to the map."""
        dense = points[rows_of_first_in_voxel(points, DENSE * self._map.voxel)]
        shuffled = dense[np.random.default_rng(0).permutation(len(dense))]  # else the first measured points would win
        source = shuffled[rows_of_first_in_voxel(shuffled, SPARSE * self._map.voxel)]
        threshold = float(np.sqrt(self._squares / self._n))
        T = align(source, T_world_predicted, self._map, threshold)
        turned = np.clip((np.trace(T_world_predicted[:3, :3].T @ T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)
        moved = np.linalg.norm(T[:3, 3] - T_world_predicted[:3, 3])
        off = moved + 2.0 * self._map.max_range * np.sin(0.5 * np.arccos(turned))
        if off > MIN_MOTION:
            self._squares, self._n = self._squares + float(off) ** 2, self._n + 1
        self._map.add(dense @ T[:3, :3].T + T[:3, 3], T[:3, 3])
        return T


def align(source: Points, T_guess: Pose, local_map: LocalMap, threshold: float) -> Pose:
    """Return the (4, 4) pose of `source` (M, 3) in the map, from a guess off by about `threshold` metres.

    Equation: registration
    """
    T = np.array(T_guess)
    nearest, searched_at = np.full((len(source), 3), np.nan), np.zeros((len(source), 3))
    margin = np.full(len(source), -1.0)
    H, g = np.empty((6, 6)), np.empty(6)
    for _ in range(MAX_ITERATIONS):  # compiling this loop would take seconds and save a millisecond a scan
        _linearize(source, T, local_map.arrays, nearest, searched_at, margin, 3.0 * threshold, threshold, H, g)
        if H[0, 0] == 0.0:  # no correspondences
            break
        for k in range(6):
            H[k, k] += 1e-9 * (H[0, 0] + H[3, 3] + H[4, 4] + H[5, 5])  # for degenerate cases such as a single point
        step = np.linalg.solve(H, -g)  # translation of the sensor, and rotation about its position
        T[:3, :3] = _rotation(*step[3:].tolist()) @ T[:3, :3]
        T[:3, 3] += step[:3]
        if np.sqrt(step @ step) < CONVERGENCE:
            break
    return T if np.isfinite(T).all() else T_guess


@kernel
def _enter(firsts, keys, rows, voxel):  # type: ignore[no-untyped-def]
    """Insert the voxels of `firsts` (V, 3), one point each, into the table."""
    for row in range(len(firsts)):
        key = voxel_key(firsts[row, 0], firsts[row, 1], firsts[row, 2], 1.0 / voxel)
        slot = find_slot(keys, key)
        keys[slot], rows[slot] = key, row


@kernel
def _add_points(points, local_map, n):  # type: ignore[no-untyped-def]
    """Add points to their voxels unless these are full or hold a near point; return the number of voxels."""
    keys, rows, cells, counts, voxel = local_map
    capacity = cells.shape[1]
    apart = voxel * voxel / capacity
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        key = voxel_key(x, y, z, 1.0 / voxel)
        slot = find_slot(keys, key)
        if keys[slot] == -1:
            keys[slot], rows[slot] = key, n
            counts[n] = 0
            n += 1
        row = rows[slot]
        count = counts[row]
        is_new = count < capacity
        for k in range(count):
            if not is_new:
                break
            dx, dy, dz = x - cells[row, k, 0], y - cells[row, k, 1], z - cells[row, k, 2]
            is_new = dx * dx + dy * dy + dz * dz >= apart
        if is_new:
            cells[row, count, 0], cells[row, count, 1], cells[row, count, 2] = x, y, z
            counts[row] = count + 1
    return n


@kernel
def _find_nearest(x, y, z, local_map, nearest):  # type: ignore[no-untyped-def]
    """Write the nearest point in a voxel or its neighbours to `nearest`; return its distance and a second one.

    No other point, including those beyond the neighbouring voxels, is nearer than the second distance.
    """
    keys, rows, cells, counts, voxel = local_map
    center = voxel_key(x, y, z, 1.0 / voxel)
    fx, fy, fz = x / voxel, y / voxel, z / voxel
    fx, fy, fz = voxel * (fx - np.floor(fx)), voxel * (fy - np.floor(fy)), voxel * (fz - np.floor(fz))
    best, second = np.inf, np.inf
    nearest[0] = np.nan
    for v in range(len(AROUND)):
        ox, oy, oz = AROUND[v, 0], AROUND[v, 1], AROUND[v, 2]
        gx = fx if ox < 0 else (voxel - fx if ox > 0 else 0.0)
        gy = fy if oy < 0 else (voxel - fy if oy > 0 else 0.0)
        gz = fz if oz < 0 else (voxel - fz if oz > 0 else 0.0)
        if gx * gx + gy * gy + gz * gz >= second:
            continue
        slot = find_slot(keys, center + ox * ALONG_X + oy * ALONG_Y + oz * ALONG_Z)
        if keys[slot] == -1:
            continue
        row = rows[slot]
        for k in range(counts[row]):
            dx, dy, dz = x - cells[row, k, 0], y - cells[row, k, 1], z - cells[row, k, 2]
            square = dx * dx + dy * dy + dz * dz
            if square < best:
                best, second = square, best
                nearest[0], nearest[1], nearest[2] = cells[row, k, 0], cells[row, k, 1], cells[row, k, 2]
            elif square < second:
                second = square
    return np.sqrt(best), min(np.sqrt(second), voxel)


def _rotation(x: float, y: float, z: float) -> Pose:
    """Return the (3, 3) rotation matrix of a rotation vector; ten times as fast as `se3_exp`."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return np.eye(3)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / angle
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)


@kernel
def _linearize(source, T, local_map, nearest, searched_at, margin, max_distance, kernel, H, g):  # type: ignore[no-untyped-def]
    """Write the normal equations of the small motion about the sensor's position that aligns points with the map.

    `nearest`, `searched_at` and `margin` cache each correspondence: it is kept while no other point can be nearer.
    """
    H[:], g[:], W = 0.0, 0.0, 0.0
    s, r, first, cross, second = np.empty(3), np.empty(3), np.zeros(3), np.zeros(3), np.zeros((3, 3))
    for i in range(len(source)):
        px, py, pz = float(source[i, 0]), float(source[i, 1]), float(source[i, 2])
        for k in range(3):
            s[k] = T[k, 0] * px + T[k, 1] * py + T[k, 2] * pz
        x, y, z = s[0] + T[0, 3], s[1] + T[1, 3], s[2] + T[2, 3]
        moved = np.sqrt((x - searched_at[i, 0]) ** 2 + (y - searched_at[i, 1]) ** 2 + (z - searched_at[i, 2]) ** 2)
        r[0], r[1], r[2] = x - nearest[i, 0], y - nearest[i, 1], z - nearest[i, 2]
        distance = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
        if not distance <= margin[i] - moved:  # true of NaN
            distance, margin[i] = _find_nearest(x, y, z, local_map, nearest[i])
            searched_at[i, 0], searched_at[i, 1], searched_at[i, 2] = x, y, z
            r[0], r[1], r[2] = x - nearest[i, 0], y - nearest[i, 1], z - nearest[i, 2]
        if not distance < max_distance:
            continue
        w = (kernel / (kernel + distance * distance)) ** 2
        W += w
        for k in range(3):
            first[k] += w * s[k]
            g[k] += w * r[k]
            for j in range(3):
                second[k, j] += w * s[k] * s[j]
        cross[0] += w * (s[1] * r[2] - s[2] * r[1])
        cross[1] += w * (s[2] * r[0] - s[0] * r[2])
        cross[2] += w * (s[0] * r[1] - s[1] * r[0])
    trace = second[0, 0] + second[1, 1] + second[2, 2]
    for k in range(3):
        H[k, k], g[3 + k] = W, cross[k]
        for j in range(3):
            H[3 + k, 3 + j] = (trace if k == j else 0.0) - second[k, j]
    H[0, 4], H[0, 5], H[1, 3] = first[2], -first[1], -first[2]
    H[1, 5], H[2, 3], H[2, 4] = first[0], first[1], -first[0]
    for k in range(3):
        for j in range(3):
            H[3 + j, k] = H[k, 3 + j]
