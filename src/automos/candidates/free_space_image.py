"""What one scan saw, as images that answer in a few reads how far the rays around a direction went.

Two windows are kept per cell. The near window (3 x 3 cells, about one ray to each side) holds the shortest and longest
range there: a surface's slope and the edges of things are in their difference. The clear pyramid holds the shortest
range of anything but ground in windows of ever coarser cells: whether a place the size of a fist or a head was empty.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_pattern import BeamPattern
from automos.cells import sine_bin, turn_of
from automos.kernels import kernel
from automos.scan import OBJECT, Mask, Points

UNIT = 0.01
"""Metres per step of the stored ranges."""
_NONE = 65535
"""Shortest range stored where no ray went."""
_N_LEVELS = 5
SUPPORT, SUPPORT_PER_METRE = 0.3, 0.02
"""Metres, and metres per metre of range: neighbouring rays that differ by less have met the same thing."""

_Image = npt.NDArray[np.uint16]


class PyramidShape(NamedTuple):
    """How the levels of a clear pyramid lie in memory.

    Attributes
    ----------
    shifts : (L, 2) int64, binary logarithms of a cell's rows and columns.
    shapes : (L, 2) int64, rows and columns of each level.
    offsets : (L + 1,) int64, where each level begins.
    widths : (L,) float32, radians, the longer side of a cell.
    """

    shifts: npt.NDArray[np.int64]
    shapes: npt.NDArray[np.int64]
    offsets: npt.NDArray[np.int64]
    widths: npt.NDArray[np.float32]


class RangeImage(NamedTuple):
    """Ranges of one scan on its sensor's grid of rays, in units of `UNIT`.

    Attributes
    ----------
    rays : (H, W, 2) uint16, nearest and farthest of the rays in each cell; 65535 and 0 where there is none.
    around : (H, W, 2) uint16, the same over the 3 x 3 cells around each cell.
    clear : (K,) uint16, shortest range of non-ground rays in 3 x 3 cells, level by level.
    """

    rays: _Image
    around: _Image
    clear: _Image


def pyramid_shape(pattern: BeamPattern) -> PyramidShape:
    """Return the levels of the clear pyramid; columns are merged before rows until cells are about square."""
    lead = max(round(float(np.log2(pattern.row_height / pattern.column_width))), 0)
    shifts = np.array([[max(level - lead, 0), level] for level in range(_N_LEVELS)])
    shapes = -(-np.array([[pattern.n_rows, pattern.n_columns]]) // (1 << shifts))
    offsets = np.concatenate([[0], np.cumsum(shapes.prod(axis=1))])
    widths = ((1 << shifts) * [pattern.row_height, pattern.column_width]).max(axis=1)
    return PyramidShape(shifts, shapes, offsets, widths.astype(np.float32))


class Projection(NamedTuple):
    """Where the points of one scan fall on its sensor's grid of rays.

    Attributes
    ----------
    cell : (M,) int32, row times columns plus column of each point; -1 for what is not seen.
    steps : (M,) uint16, range in units of `UNIT`.
    rays : (H, W, 2) uint16, nearest and farthest range in each cell; 65535 and 0 where there is none.
    """

    cell: npt.NDArray[np.int32]
    steps: npt.NDArray[np.uint16]
    rays: _Image


def project(points: Points, is_seen: Mask, pattern: BeamPattern) -> Projection:
    """Return where `points` (M, 3), sensor frame of the raw sweep, fall on the grid; only what `is_seen` (M,) does."""
    h, w = pattern.n_rows, pattern.n_columns
    rays = np.empty((h, w, 2), np.uint16)
    rays[..., 0], rays[..., 1] = _NONE, 0
    projection = Projection(np.empty(len(points), np.int32), np.empty(len(points), np.uint16), rays)
    _project(points, is_seen, pattern.row_of_sine, *projection)
    return projection


def find_neighbours(
    projection: Projection, kind: npt.NDArray[np.uint8]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Return for each object (`kind` (M,)) in how many directions it goes on, and how solid it is.

    Returns
    -------
    ways : (M,) uint8, up or down and sideways. A drop of rain, dust or an insect is met by one ray only: 0. A twig, a
        wire or the edge of a slab fits between the rays of other scans: 1. What other rays of the same scan have met
        both ways is a thing that those would meet: 2.
    solidity : (M,) uint8, 255 where the rays right beside it that returned all ended beside it, 0 where none did: faces
        of solid things return the rays that meet them, dust and leaves let most of them through.
    """
    ways, solidity = np.zeros((2, len(kind)), np.uint8)
    _count_neighbours(*projection, kind, ways, solidity)
    return ways, solidity


def make_image(projection: Projection, kind: npt.NDArray[np.uint8], pyramid: PyramidShape) -> RangeImage:
    """Return the range image of projected points of `kind` (M,): what is no object is transparent to `clear`."""
    rays = projection.rays
    solid = np.full(rays.shape[:2], _NONE, np.uint16)
    _keep_nearest(projection.cell, projection.steps, kind, solid.reshape(-1))
    around = np.empty_like(rays)
    _window(rays, around)
    clear = np.empty(pyramid.offsets[-1], np.uint16)
    for k in range(_N_LEVELS):
        if k > 0:
            step = 1 << (pyramid.shifts[k] - pyramid.shifts[k - 1])
            coarser = np.empty(pyramid.shapes[k], np.uint16)
            _merge(solid, step[0], step[1], coarser)
            solid = coarser
        _shortest_around(solid, clear[pyramid.offsets[k] : pyramid.offsets[k + 1]].reshape(pyramid.shapes[k]))
    return RangeImage(rays, around, clear)


@kernel
def _project(points, is_seen, row_of_sine, cell, steps, rays):  # type: ignore[no-untyped-def]
    h, w, _ = rays.shape
    for i in range(len(points)):
        cell[i] = -1
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r = np.sqrt(x * x + y * y + z * z)
        row = row_of_sine[sine_bin(z, r, len(row_of_sine))]
        if not (is_seen[i] and 0.0 <= row < h):
            continue
        v, u = int(row), int(turn_of(x, y) * np.float32(w))
        far = r * np.float32(1.0 / UNIT)
        q = np.uint16(far) if far < np.float32(_NONE - 1) else np.uint16(_NONE - 1)
        cell[i], steps[i] = v * w + u, q
        rays[v, u, 0] = min(rays[v, u, 0], q)
        rays[v, u, 1] = max(rays[v, u, 1], q)


@kernel
def _keep_nearest(cell, steps, kind, solid):  # type: ignore[no-untyped-def]
    for i in range(len(cell)):
        if cell[i] >= 0 and kind[i] == OBJECT:
            solid[cell[i]] = min(solid[cell[i]], steps[i])


@kernel
def _count_neighbours(cell, steps, rays, kind, ways, solidity):  # type: ignore[no-untyped-def]
    h, w, _ = rays.shape
    for i in range(len(cell)):
        if cell[i] < 0 or kind[i] != OBJECT:
            continue
        v, u, q = cell[i] // w, cell[i] % w, np.float32(steps[i])
        near = np.float32(SUPPORT / UNIT) + np.float32(SUPPORT_PER_METRE) * q
        has_neighbour, goes_up, goes_sideways, n_near, n_beside = False, False, False, 0, 0
        for reach in range(1, 3):
            if goes_up and goes_sideways:  # right beside it, as most do: who is further tells nothing new
                break
            for b in range(max(v - reach, 0), min(v + reach + 1, h)):
                # Of the outer ring rows at its ends are whole, of those between there are the two ends.
                step = 1 if reach == 1 or abs(b - v) == reach else 2 * reach
                for a in range(u - reach, u + reach + 1, step):
                    first, last = rays[b, a - w if a >= w else a]
                    if last == 0 or (b == v and a == u and first == last):  # no ray, or the point itself
                        continue
                    is_near = abs(np.float32(first) - q) < near or abs(np.float32(last) - q) < near
                    if is_near:
                        has_neighbour = True
                        goes_up |= b != v and abs(a - u) < 2
                        goes_sideways |= a != u and abs(b - v) < 2
                    if reach == 1:
                        n_near += is_near
                        n_beside += 1
        ways[i] = 2 if goes_up and goes_sideways else (1 if has_neighbour else 0)
        solidity[i] = 255 * n_near // max(n_beside, 1)


@kernel
def _window(rays, around):  # type: ignore[no-untyped-def]
    """Write the shortest and longest of the 3 x 3 cells around each; columns go round."""
    h, w, _ = rays.shape
    low, high = np.empty(w + 2, np.uint16), np.empty(w + 2, np.uint16)
    for v in range(h):
        a, b = max(v - 1, 0), min(v + 1, h - 1)
        for u in range(w):
            low[u + 1] = min(rays[v, u, 0], min(rays[a, u, 0], rays[b, u, 0]))
            high[u + 1] = max(rays[v, u, 1], max(rays[a, u, 1], rays[b, u, 1]))
        low[0], low[w + 1], high[0], high[w + 1] = low[w], low[1], high[w], high[1]
        for u in range(w):
            around[v, u, 0] = min(low[u], min(low[u + 1], low[u + 2]))
            around[v, u, 1] = max(high[u], max(high[u + 1], high[u + 2]))


@kernel
def _shortest_around(solid, out):  # type: ignore[no-untyped-def]
    h, w = solid.shape
    low = np.empty(w + 2, np.uint16)
    for v in range(h):
        a, b = max(v - 1, 0), min(v + 1, h - 1)
        for u in range(w):
            low[u + 1] = min(solid[v, u], min(solid[a, u], solid[b, u]))
        low[0], low[w + 1] = low[w], low[1]
        for u in range(w):
            out[v, u] = min(low[u], min(low[u + 1], low[u + 2]))


@kernel
def _merge(fine, rows, columns, coarse):  # type: ignore[no-untyped-def]
    """Write the shortest range of each block of `rows` x `columns` cells."""
    h, w = fine.shape
    for v in range(coarse.shape[0]):
        for u in range(coarse.shape[1]):
            low = np.uint16(_NONE)
            for b in range(v * rows, min((v + 1) * rows, h)):
                for a in range(u * columns, min((u + 1) * columns, w)):
                    low = min(low, fine[b, a])
            coarse[v, u] = low
