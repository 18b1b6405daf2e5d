"""Range images of one scan, from which a few reads give the ranges of the rays around a direction.

Two windows are kept per cell. The near window (3 x 3 cells, about one ray to each side) holds the shortest and the
longest range; their difference shows the slope of a surface and the edges of objects. The clear pyramid holds the
shortest range of anything but ground in windows of increasingly coarse cells: was a place of a given width free?
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.beam_pattern import BeamPattern
from automos.core.cells import sine_bin, turn_of
from automos.core.kernels import kernel
from automos.core.scan import Mask, Points

UNIT = 0.01  # metres per step of the stored ranges
NO_RAY = 65535  # shortest range stored in cells without a ray
SUPPORT, SUPPORT_PER_METRE = 0.3, 0.02
"""Metres, and metres per metre of range: neighbouring rays that differ by less have met the same object."""
_Image = npt.NDArray[np.uint16]


class RangeImage(NamedTuple):
    """The ranges of one sweep on its sensor's grid of rays, in units of `UNIT`."""

    pattern: BeamPattern  # with the times of this sweep
    motion: npt.NDArray[np.float32]  # (6,) twist of the sensor over the sweep
    rays: _Image  # (H, W, 2) nearest and farthest range in each cell; `NO_RAY` and 0 where there is no ray
    around: _Image  # (H, W, 2) the same over the 3 x 3 cells around each cell
    clear: _Image  # (K,) shortest range of object points in 3 x 3 cells, for each level of the grid's pyramid


class Projection(NamedTuple):
    """The M points of one scan on its sensor's grid of rays."""

    cell: npt.NDArray[np.int32]  # (M,) row * columns + column, -1 if outside of the grid or left out
    steps: npt.NDArray[np.uint16]  # (M,) range in units of `UNIT`
    rays: _Image  # as in `RangeImage`


def locate(points: Points, pattern: BeamPattern) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Return the cell (see `Projection`) and the range (metres) of each of `points` (M, 3), frame of the raw sweep."""
    return _locate(points, pattern.row_of_sine, pattern.n_rows, pattern.n_columns)


def project(points: Points, pattern: BeamPattern, is_seen: Mask | None = None) -> Projection:
    """Return the projection of `points` (M, 3), frame of the raw sweep; all of them, or those `is_seen` (M,)."""
    cell, ranges = locate(points, pattern)
    steps = np.minimum(ranges * np.float32(1.0 / UNIT), np.float32(NO_RAY - 1)).astype(np.uint16)
    if is_seen is not None:
        cell[~is_seen] = -1
    return Projection(cell, steps, _extreme_ranges(cell, steps, pattern.n_rows, pattern.n_columns))


def find_neighbours(projection: Projection, is_object: Mask) -> npt.NDArray[np.uint8]:
    """Return (3, M) the number of directions in which object points have neighbours, solidity, and if between two.

    Without neighbours only one ray met it: a drop of rain, dust, an insect. In one direction, vertical or horizontal,
    it is a twig, a wire or the edge of a slab, which fits between the rays of other scans. In 2 directions, rays of
    other scans would meet it, too. Solidity is the share of the directly adjacent returned rays that ended beside it,
    255 for all: solid faces return the rays that meet them; dust and leaves let most of them through. A point is
    between two neighbours if the rays next to it on the left and on the right, or above and below, ended beside it.
    """
    return _count_neighbours(*projection, is_object)


def make_image(
    projection: Projection, pattern: BeamPattern, motion: npt.NDArray[np.float32], is_object: Mask
) -> RangeImage:
    """Return the range image of projected points (M,); `clear` ignores all but object points."""
    nearest = np.full(projection.rays.shape[:2], NO_RAY, np.uint16)
    seen = np.flatnonzero(is_object & (projection.cell >= 0))
    np.minimum.at(nearest.reshape(-1), projection.cell[seen], projection.steps[seen])
    clear = [over_neighbours(nearest, np.minimum).reshape(-1)]
    for is_merged in np.diff(pattern.pyramid.shifts, axis=0):
        for axis in np.flatnonzero(is_merged):
            nearest = _merged(nearest, int(axis))
        clear.append(over_neighbours(nearest, np.minimum).reshape(-1))
    around = [over_neighbours(projection.rays[..., k], extreme) for k, extreme in enumerate((np.minimum, np.maximum))]
    return RangeImage(pattern, motion, projection.rays, np.stack(around, axis=-1), np.concatenate(clear))


def _merged(image: _Image, axis: int) -> _Image:
    """Return the minimum of every two cells along `axis` of `image` (H, W); the last of an odd number is copied."""
    image = np.moveaxis(image, axis, 0)
    nearer = image[::2].copy()
    np.minimum(nearer[: len(image) // 2], image[1::2], out=nearer[: len(image) // 2])
    return np.moveaxis(nearer, 0, axis)


def over_neighbours(image: npt.NDArray, extreme: np.ufunc) -> npt.NDArray:
    """Return `extreme` (np.minimum, np.maximum) of 3 x 3 cells around each of `image` (H, W); columns wrap around."""
    rows = image.copy()
    extreme(rows[1:], image[:-1], out=rows[1:])
    extreme(rows[:-1], image[1:], out=rows[:-1])
    return extreme(rows, extreme(np.roll(rows, 1, axis=1), np.roll(rows, -1, axis=1)))


@kernel
def _locate(points, row_of_sine, h, w):  # type: ignore[no-untyped-def]
    cell, ranges = np.empty(len(points), np.int32), np.empty(len(points), np.float32)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ranges[i] = np.sqrt(x * x + y * y + z * z)
        row = row_of_sine[sine_bin(z, ranges[i], len(row_of_sine))]
        cell[i] = int(row) * w + int(turn_of(x, y) * np.float32(w)) if 0.0 <= row < h else -1
    return cell, ranges


@kernel
def _extreme_ranges(cell, steps, h, w):  # type: ignore[no-untyped-def]
    """Return (h, w, 2) the `rays` of the projection."""
    rays = np.zeros((h * w, 2), np.uint16)
    rays[:, 0] = NO_RAY
    for i in range(len(cell)):
        if cell[i] >= 0:
            rays[cell[i], 0] = min(rays[cell[i], 0], steps[i])
            rays[cell[i], 1] = max(rays[cell[i], 1], steps[i])
    return rays.reshape((h, w, 2))


@kernel
def _count_neighbours(cell, steps, rays, is_object):  # type: ignore[no-untyped-def]
    h, w, _ = rays.shape
    counted = np.zeros((3, len(cell)), np.uint8)
    n_directions, solidity, is_between = counted
    for i in range(len(cell)):
        if cell[i] < 0 or not is_object[i]:
            continue
        v, u, q = cell[i] // w, cell[i] % w, np.float32(steps[i])
        near = np.float32(SUPPORT / UNIT) + np.float32(SUPPORT_PER_METRE) * q
        has_neighbour, goes_up, goes_sideways, n_near, n_beside = False, False, False, 0, 0
        for reach in range(1, 3):
            if goes_up and goes_sideways:  # both found directly beside it, as for most points
                break
            for b in range(max(v - reach, 0), min(v + reach + 1, h)):
                # The outer ring: all of its first and last row, and the two ends of the rows between.
                step = 1 if reach == 1 or abs(b - v) == reach else 2 * reach
                for a in range(u - reach, u + reach + 1, step):
                    first, last = rays[b, a - w if a >= w else a]
                    if last == 0 or (b == v and a == u and first == last):  # no ray, or the point itself
                        continue
                    is_near = _is_near(first, last, q, near)
                    if is_near:
                        has_neighbour = True
                        goes_up |= b != v and abs(a - u) < 2
                        goes_sideways |= a != u and abs(b - v) < 2
                    if reach == 1:
                        n_near += is_near
                        n_beside += 1
        n_directions[i] = 2 if goes_up and goes_sideways else (1 if has_neighbour else 0)
        solidity[i] = 255 * n_near // max(n_beside, 1)
        is_between[i] = _is_between(rays, v, u, q, near)
    return counted


@kernel
def _is_between(rays, v, u, q, near):  # type: ignore[no-untyped-def]
    """Return whether the nearest rays on two opposite sides ended within `near` of the range `q` of cell (v, u)."""
    h, w, _ = rays.shape
    for down, right in ((0, 1), (1, 0)):
        n_near = 0
        for side in (-1, 1):
            for step in range(1, 3):  # rays at the border of two cells leave every second one empty
                b, a = v + side * step * down, (u + side * step * right) % w
                if not 0 <= b < h or rays[b, a, 1] == 0:
                    continue
                n_near += _is_near(rays[b, a, 0], rays[b, a, 1], q, near)
                break
        if n_near == 2:
            return True
    return False


@kernel
def _is_near(first, last, q, near):  # type: ignore[no-untyped-def]
    """Return whether the nearest or the farthest range in a cell differs from `q` by less than `near`."""
    return abs(np.float32(first) - q) < near or abs(np.float32(last) - q) < near
