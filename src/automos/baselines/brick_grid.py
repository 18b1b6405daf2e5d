"""Voxels in bricks of 8 x 8 x 8, through which rays are followed.

Only voxels that some point of the batch fell into are stored: what a ray passes elsewhere can decide on no point. Most
of the air lies in bricks without any, which a ray crosses at the cost of one look-up each.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Ids = npt.NDArray[np.int32]
"""Voxels by their numbers, -1 for none."""
_SIDE_BITS = 3
_SIDE = 1 << _SIDE_BITS
_CELLS = _SIDE**3
FAR = np.uint8(255)
"""Squared steps to what is out of reach."""


class BrickGrid:
    """Voxels in order of first appearance; grows as points are added."""

    def __init__(self, voxel: float, origins: npt.NDArray, reach: float):
        """Take the voxels' edge, the sensor's positions (N, 3), level frame, and the points' reach, metres."""
        self.voxel = voxel
        self.low = np.asarray(origins, np.float64).min(axis=0) - reach - voxel
        extent = np.asarray(origins, np.float64).max(axis=0) + reach + voxel - self.low
        self._table = np.full(tuple(np.ceil(extent / (voxel * _SIDE)).astype(int) + 1), -1, np.int32)
        self._cells = np.full((1024, _CELLS), -1, np.int32)
        self._n_bricks = 0
        self.n_voxels = 0

    def __len__(self) -> int:
        return self.n_voxels

    def add(self, points: npt.NDArray) -> Ids:
        """Return (M,) int32: the voxel of each of `points` (M, 3), level frame; new if need be, -1 out of reach."""
        ids = np.empty(len(points), np.int32)
        done = 0
        while done < len(points):
            done, self._n_bricks, self.n_voxels = _insert(
                points, done, self.low, 1.0 / self.voxel, self._table, self._cells, self._n_bricks, self.n_voxels, ids
            )
            if done < len(points):  # all bricks are taken
                more = np.full((len(self._cells), _CELLS), -1, np.int32)
                self._cells = np.concatenate([self._cells, more])
        return ids

    def pass_rays(self, origin: npt.NDArray, ends: npt.NDArray, stamp: int, passed: Ids) -> None:
        """Write `stamp` into `passed` (V,) for the voxels from `origin` (3,) to before each of `ends` (M, 3)."""
        _pass_rays(np.asarray(origin), ends, self.low, 1.0 / self.voxel, self._table, self._cells, stamp, passed)

    def pass_lines(self, origin: npt.NDArray, ends: Ids, stamp: int, passed: Ids) -> None:
        """Write `stamp` into `passed` (V,) for the voxels on thin lines from `origin` (3,) to `ends` (M, 3) indices.

        A line has one voxel per step along its longest axis (Bresenham); `pass_rays` meets all that a ray touches.
        """
        start = np.floor((np.asarray(origin) - self.low) / self.voxel).astype(np.int64)
        _pass_lines(start, ends, self._table, self._cells, stamp, passed)

    def widen(self, reach: int) -> None:
        """Add the voxels within `reach` steps along each axis of those that there are."""
        for axis in range(3):
            middle = self.low + (self.indices() + 0.5) * self.voxel
            for step in range(-reach, reach + 1):
                self.add(middle + step * self.voxel * np.eye(3)[axis])

    def squared_steps(self, ids: Ids, indices: Ids, reach: int) -> npt.NDArray[np.uint8]:
        """Return (V,) uint8: squared distance in voxels from each to the nearest of `ids` (K,), `FAR` beyond `reach`.

        indices : (V, 3) int32 of all voxels (`indices`).
        """
        return _squared_steps(indices[ids], reach, self._table, self._cells, np.full(self.n_voxels, FAR))

    def neighbours(self, ids: npt.NDArray[np.integer], indices: Ids, reach: int) -> npt.NDArray:
        """Return (K, (2 reach + 1)^3) int32: the voxels around each of `ids` (K,), -1 if there is none.

        indices : (V, 3) int32 of all voxels (`indices`).
        """
        return _neighbours(ids, indices, reach, self._table, self._cells)

    def indices(self) -> Ids:
        """Return (V, 3) int32: where each voxel lies in the grid."""
        indices, corners = np.empty((self.n_voxels, 3), np.int32), np.empty((self._n_bricks, 3), np.int32)
        places = np.argwhere(self._table >= 0)
        corners[self._table[tuple(places.T)]] = places << _SIDE_BITS
        brick, cell = np.nonzero(self._cells[: self._n_bricks] >= 0)
        indices[self._cells[brick, cell]] = corners[brick] + np.stack(np.unravel_index(cell, (_SIDE,) * 3), axis=-1)
        return indices


@kernel(inline="always")
def _cell(x, y, z):  # type: ignore[no-untyped-def]
    return ((x & (_SIDE - 1)) << (2 * _SIDE_BITS)) | ((y & (_SIDE - 1)) << _SIDE_BITS) | (z & (_SIDE - 1))


@kernel
def _is_inside(point, low, per_metre, table):  # type: ignore[no-untyped-def]
    """Whether the table has a brick for a place; compared before it is made whole numbers: huge ones have none."""
    is_inside = True
    for a in range(3):
        is_inside &= 0.0 <= (point[a] - low[a]) * per_metre < table.shape[a] * _SIDE
    return is_inside


@kernel
def _insert(points, start, low, per_metre, table, cells, n_bricks, n_voxels, ids):  # type: ignore[no-untyped-def]
    """Write the voxels of `points` from `start` on into `ids`; return how far free bricks lasted, and counts."""
    for i in range(start, len(points)):
        if not _is_inside(points[i], low, per_metre, table):
            ids[i] = -1
            continue
        x = int((points[i, 0] - low[0]) * per_metre)
        y = int((points[i, 1] - low[1]) * per_metre)
        z = int((points[i, 2] - low[2]) * per_metre)
        brick = table[x >> _SIDE_BITS, y >> _SIDE_BITS, z >> _SIDE_BITS]
        if brick < 0:
            if n_bricks == len(cells):
                return i, n_bricks, n_voxels
            brick = n_bricks
            table[x >> _SIDE_BITS, y >> _SIDE_BITS, z >> _SIDE_BITS] = brick
            n_bricks += 1
        cell = _cell(x, y, z)
        if cells[brick, cell] < 0:
            cells[brick, cell] = n_voxels
            n_voxels += 1
        ids[i] = cells[brick, cell]
    return len(points), n_bricks, n_voxels


@kernel
def _pass_rays(origin, ends, low, per_metre, table, cells, stamp, passed):  # type: ignore[no-untyped-def]
    """Amanatides and Woo's walk through the voxels."""
    start, step, at, last = np.empty(3), np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    due, stride = np.empty(3), np.empty(3)
    for a in range(3):
        start[a] = (origin[a] - low[a]) * per_metre
    if not _is_inside(origin, low, per_metre, table):
        return
    for i in range(len(ends)):
        if not _is_inside(ends[i], low, per_metre, table):
            continue
        n = 0
        for a in range(3):
            end = (ends[i, a] - low[a]) * per_metre
            at[a], last[a] = int(start[a]), int(end)
            way = end - start[a]
            step[a] = 1 if way > 0.0 else -1
            stride[a] = 1.0 / max(abs(way), 1e-12)
            border = at[a] + 1.0 if way > 0.0 else float(at[a])
            due[a] = abs(border - start[a]) * stride[a]
            n += abs(last[a] - at[a])
        x, y, z = at[0], at[1], at[2]
        brick_x, brick_y, brick_z, brick = -1, -1, -1, -1
        for _ in range(n):
            if x >> _SIDE_BITS != brick_x or y >> _SIDE_BITS != brick_y or z >> _SIDE_BITS != brick_z:
                brick_x, brick_y, brick_z = x >> _SIDE_BITS, y >> _SIDE_BITS, z >> _SIDE_BITS
                brick = table[brick_x, brick_y, brick_z]
            if brick >= 0:
                v = cells[brick, _cell(x, y, z)]
                if v >= 0:
                    passed[v] = stamp
            if due[0] <= due[1] and due[0] <= due[2]:
                x += step[0]
                due[0] += stride[0]
            elif due[1] <= due[2]:
                y += step[1]
                due[1] += stride[1]
            else:
                z += step[2]
                due[2] += stride[2]


@kernel
def _neighbours(ids, indices, reach, table, cells):  # type: ignore[no-untyped-def]
    out = np.empty((len(ids), (2 * reach + 1) ** 3), np.int32)
    for i in range(len(ids)):
        n = 0
        for x in range(indices[ids[i], 0] - reach, indices[ids[i], 0] + reach + 1):
            for y in range(indices[ids[i], 1] - reach, indices[ids[i], 1] + reach + 1):
                for z in range(indices[ids[i], 2] - reach, indices[ids[i], 2] + reach + 1):
                    out[i, n] = _voxel_at(x, y, z, table, cells)
                    n += 1
    return out


@kernel
def _pass_lines(start, ends, table, cells, stamp, passed):  # type: ignore[no-untyped-def]
    for i in range(len(ends)):
        dx, dy, dz = ends[i, 0] - start[0], ends[i, 1] - start[1], ends[i, 2] - start[2]
        n = max(abs(dx), abs(dy), abs(dz), 1)
        for j in range(n + 1):
            x, y, z = (2 * j * dx + n) // (2 * n), (2 * j * dy + n) // (2 * n), (2 * j * dz + n) // (2 * n)
            v = _voxel_at(start[0] + x, start[1] + y, start[2] + z, table, cells)
            if v >= 0:
                passed[v] = stamp


@kernel
def _squared_steps(centres, reach, table, cells, out):  # type: ignore[no-untyped-def]
    for i in range(len(centres)):
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                for dz in range(-reach, reach + 1):
                    square = dx * dx + dy * dy + dz * dz
                    if square <= reach * reach:
                        v = _voxel_at(centres[i, 0] + dx, centres[i, 1] + dy, centres[i, 2] + dz, table, cells)
                        if v >= 0:
                            out[v] = min(out[v], square)
    return out


@kernel(inline="always")
def _voxel_at(x, y, z, table, cells):  # type: ignore[no-untyped-def]
    """The voxel at an index, -1 if there is none."""
    bx, by, bz = x >> _SIDE_BITS, y >> _SIDE_BITS, z >> _SIDE_BITS
    if 0 <= bx < table.shape[0] and 0 <= by < table.shape[1] and 0 <= bz < table.shape[2]:
        brick = table[bx, by, bz]
        if brick >= 0:
            return cells[brick, _cell(x, y, z)]
    return np.int32(-1)
