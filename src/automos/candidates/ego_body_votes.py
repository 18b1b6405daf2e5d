"""Body or world? What other scans say of what keeps its place in the sensor's frame.

Were it of the world, another scan would see it where the poses say, or its end where it ends; were it of the body,
that place would be free, or taken by another part of the body. So a ray of another scan that goes on through the
place speaks for the body, one that ends there for the world, and one that meets what may be body itself says nothing.
No distance need be gone for that: the edges of a hull show it, when a boat rolls at its quay. Inside a wide deck
nothing does, nor where rays past the body meet water and do not return; there the rest of a part speaks for all of it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from automos.candidates.ego_body_ranges import Ranges, cells_within
from automos.candidates.free_space_grid import BeamPattern, directions
from automos.candidates.free_space_image import make_image, over_neighbours, project
from automos.candidates.free_space_sweep import motion_of, raw_points
from automos.candidates.free_space_vote import EDGE, HIT, Rays, look_through
from automos.geometry import inverse, transform
from automos.scan import Frame, Mask

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
"""Share of hits among the reports from which a cell is the world's."""
_LEAST_SHARE = 0.02
"""Share of free-space observations among the reports below which they may be noise of the poses."""


def ask_others(frames: list[Frame], pattern: BeamPattern, reach: Ranges) -> npt.NDArray[np.float64]:
    """Return (3, H, W) how often each cell was reported on, hit, and observed free.

    Each of `frames` reports on what all others saw nearer than `reach` (H, W), metres.
    """
    raws = [raw_points(frame) for frame in frames]
    projections = [project(raw, pattern) for raw in raws]
    images = [make_image(seen, pattern.pyramid, seen.cell >= 0) for seen in projections]
    scans = [(f, Rays(pattern, motion_of(f), image)) for f, image in zip(frames, images, strict=True)]
    may_be_met = over_neighbours(np.where(reach > 0.0, reach + np.float32(_BEFORE), np.float32(0.0)), np.maximum)
    votes = np.zeros((3, reach.size))
    for frame, raw in zip(frames, raws, strict=True):
        cell = cells_within(raw, reach, pattern)
        rows = np.flatnonzero(cell >= 0)
        rows = rows[:: max(len(rows) // _ASKED, 1)]
        points, of_points = np.take(frame.points, rows, axis=0), np.zeros((3, len(rows)))
        for other, rays in scans:
            if other is frame:
                continue
            T = inverse(other.T_level_sensor) @ frame.T_level_sensor
            codes, _, _ = look_through(np.ascontiguousarray(points.T), T[:3].astype(np.float32), rays, _TOLERANCES)
            meets_itself = cells_within(transform(T, points), may_be_met, pattern) >= 0
            of_points += codes >= EDGE, (codes == HIT) & ~meets_itself, codes > HIT
        votes += [np.bincount(cell[rows], of_kind, reach.size) for of_kind in of_points]
    return votes.reshape(3, *reach.shape)


def decide(votes: npt.NDArray[np.float64], pattern: BeamPattern, reach: Ranges) -> Mask:
    """Return (H, W) bool: at which cells' `reach` (H, W; 0 for none) the body is, by the `votes` (3, H, W) on them."""
    reported, hits, through = votes
    is_body = (reach > 0.0) & ~((hits > _WORLD_SHARE * reported) & (hits >= through))
    v, u = np.nonzero(is_body)
    part, n_parts = parts_of(directions(pattern, v, u) * reach[v, u][:, None])
    reported, hits, through = (np.bincount(part, of_cells[v, u], n_parts) for of_cells in votes)
    is_body[v, u] = ((through > hits) & (through > _LEAST_SHARE * reported))[part]
    return is_body


def parts_of(points: npt.NDArray) -> tuple[npt.NDArray[np.int32], int]:
    """Return (M,) which part each of `points` (M, 3) belongs to, and one more than the last of them."""
    if len(points) == 0:
        return np.zeros(0, np.int32), 0
    voxels = np.floor(points / _VOXEL).astype(np.int64)
    voxels -= voxels.min(axis=0)
    grid = np.zeros(voxels.max(axis=0) + 1, np.bool_)
    grid[tuple(voxels.T)] = True
    parts, n_parts = ndimage.label(grid, np.ones((3, 3, 3), bool))
    return parts[tuple(voxels.T)], n_parts + 1
