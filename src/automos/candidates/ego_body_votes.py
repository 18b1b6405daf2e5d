"""Body or world? What other scans say of what keeps its place in the sensor's frame.

Were it of the world, another scan would see it where the poses say, or its end where it ends; were it of the body,
that place would be empty, or taken by another part of the body. So a ray of another scan that goes on through the
place speaks for the body, one that ends there for the world, and one that meets what may be body itself says nothing.
No distance need be gone for that: the edges of a hull tell, when a boat rolls at its quay. Inside a wide deck nothing
tells, nor where rays past the body meet water and do not return; what the rest of a part says holds there, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from automos.candidates.ego_body_ranges import cell_of
from automos.candidates.free_space_image import make_image, project, pyramid_shape
from automos.candidates.free_space_pattern import BeamPattern, directions, raw_points
from automos.candidates.free_space_vote import EDGE, HIT, look_through
from automos.geometry import inverse
from automos.kernels import kernel
from automos.scan import OBJECT, Frame, Mask

Array = npt.NDArray[np.float64]

_ASKED = 20_000
"""Points of a scan, at most, about which others are asked."""
_TOLERANCES = tuple(np.float32(x) for x in (0.2, 0.005, 0.25, 0.01, 0.2))
"""Of `look_through`."""
_BEFORE = 0.35
"""Metres before what may be body from which a ray that ends at a point may have met it: the tolerance of a hit and a
little more."""
_VOXEL = 0.3
"""Metres: points in neighbouring voxels hang together."""
_WORLD_SHARE = 0.05
"""Share of hits among the looks that tell anything from which a cell is the world's."""
_LEAST_SHARE = 0.02
"""Share of see-throughs among the looks that tell anything below which they may be noise of the poses."""


class Votes(NamedTuple):
    """How often each cell (H, W) was told anything of, and how often rays ended at its place or went through."""

    told: Array
    hits: Array
    through: Array


def ask_others(frames: list[Frame], pattern: BeamPattern, reach: npt.NDArray[np.float32]) -> Votes:
    """Return what each of `frames` says of what others saw nearer than `reach` (H, W), metres."""
    pyramid, n_cells = pyramid_shape(pattern), reach.size
    raws = [raw_points(frame) for frame in frames]
    images = [
        make_image(project(raw, np.ones(len(raw), np.bool_), pattern), np.full(len(raw), OBJECT, np.uint8), pyramid)
        for raw in raws
    ]
    may_be_met = ndimage.maximum_filter(reach, size=3, mode=("nearest", "wrap"))
    told, hits, through = np.zeros((3, n_cells))
    for frame, raw in zip(frames, raws, strict=True):
        cell = np.full(len(raw), -1, np.int64)
        cells_within(raw, pattern.row_of_sine, reach, cell)
        rows = np.flatnonzero(cell >= 0)
        rows = rows[:: max(len(rows) // _ASKED, 1)]
        cell, points = cell[rows], np.ascontiguousarray(np.take(frame.points, rows, axis=0).T)
        codes, (ranges, misses) = np.empty(len(rows), np.uint8), np.empty((2, len(rows)), np.float32)
        meets_itself = np.empty(len(rows), np.bool_)
        for other, image in zip(frames, images, strict=True):
            if other is frame:
                continue
            T = (inverse(other.T_level_sensor) @ frame.T_level_sensor)[:3].astype(np.float32)
            motion = np.zeros(6) if other.sweep_motion is None or other.sweep_time is None else other.sweep_motion
            scan = (np.asarray(motion, np.float32), pattern, pyramid, image)
            look_through(points, T, *scan, _TOLERANCES, codes, ranges, misses)
            _meets(points, T, pattern.row_of_sine, may_be_met, np.float32(_BEFORE), meets_itself)
            told += np.bincount(cell, codes >= EDGE, n_cells)
            hits += np.bincount(cell, (codes == HIT) & ~meets_itself, n_cells)
            through += np.bincount(cell, codes > HIT, n_cells)
    return Votes(*(votes.reshape(reach.shape) for votes in (told, hits, through)))


def decide(votes: Votes, pattern: BeamPattern, reach: npt.NDArray[np.float32]) -> Mask:
    """Return (H, W) bool: cells at whose `reach` (H, W; 0 for nothing) the body is, by the votes on them."""
    is_body = reach > 0.0
    is_body &= ~((votes.hits > _WORLD_SHARE * votes.told) & (votes.hits >= votes.through))
    v, u = np.nonzero(is_body)
    if len(v) == 0:
        return is_body
    part, n_parts = parts_of(directions(pattern, v, u) * reach[v, u][:, None])
    told, hits, through = (np.bincount(part, of_cells[v, u], n_parts) for of_cells in votes)
    is_body[v, u] = ((through > hits) & (through > _LEAST_SHARE * told))[part]
    return is_body


def parts_of(points: npt.NDArray) -> tuple[npt.NDArray[np.int32], int]:
    """Return (M,) which part each of `points` (M, 3), at least one, belongs to, and one more than the last of them."""
    voxels = np.floor(points / _VOXEL).astype(np.int64)
    voxels -= voxels.min(axis=0)
    grid = np.zeros(voxels.max(axis=0) + 1, np.bool_)
    grid[tuple(voxels.T)] = True
    parts, n_parts = ndimage.label(grid, np.ones((3, 3, 3), bool))
    return parts[tuple(voxels.T)], n_parts + 1


@kernel
def cells_within(points, row_of_sine, reach, cell):  # type: ignore[no-untyped-def]
    """Write the cell (row times columns plus column) of each point nearer than its cell's reach."""
    h, w = reach.shape
    farthest = np.float32(0.0)
    for v in range(h):  # `reach.max()` takes most of a second to compile
        for u in range(w):
            farthest = max(farthest, reach[v, u])
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if x * x + y * y + z * z < farthest * farthest:
            r, v, u = cell_of(x, y, z, row_of_sine, h, w)
            if v >= 0 and r < reach[v, u]:
                cell[i] = v * w + u


@kernel
def _meets(points, T, row_of_sine, reach, before, meets):  # type: ignore[no-untyped-def]
    """Mark which of `points` (3, K), taken by `T` (3, 4) to another scan, lie no farther than `reach` (H, W) there."""
    h, w = reach.shape
    for i in range(points.shape[1]):
        a, b, c = points[0, i], points[1, i], points[2, i]
        x = T[0, 0] * a + T[0, 1] * b + T[0, 2] * c + T[0, 3]
        y = T[1, 0] * a + T[1, 1] * b + T[1, 2] * c + T[1, 3]
        z = T[2, 0] * a + T[2, 1] * b + T[2, 2] * c + T[2, 3]
        r, v, u = cell_of(x, y, z, row_of_sine, h, w)
        meets[i] = v >= 0 and r - before < reach[v, u]
