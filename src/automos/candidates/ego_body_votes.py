"""Body or world: votes of other scans on points that keep their place in the sensor's frame.

Other scans hit a point of the world where the poses place it. If it is body, they observe that place free, or hit
another part of the body there. So a ray of another scan that passes through the place is a vote for the
body, a ray that ends there is one for the world, and a ray that meets a possible body counts for neither.
No displacement is needed: the edges of a hull suffice when a boat rolls at its quay. There are no votes inside a wide
deck, nor where rays past the body meet water and do not return; there the votes on the rest of a part decide.
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
"""Greatest number of points of a scan that others vote on."""
_TOLERANCES = tuple(np.float32(x) for x in (0.2, 0.005, 0.25, 0.01, 0.2))
"""The tolerances of `look_through`."""
_BEFORE = 0.35
"""Metres, how far beyond a possible body a ray may end that has met it: a little more than the tolerance of a hit."""
_VOXEL = 0.3
"""Metres: points in neighbouring voxels are connected."""
_WORLD_SHARE = 0.05
"""Share of hits among the reports above which a cell is world."""
_LEAST_SHARE = 0.02
"""Share of free-space observations among the reports; fewer may be due to errors of the poses."""


def ask_others(frames: list[Frame], pattern: BeamPattern, reach: Ranges) -> npt.NDArray[np.float64]:
    """Return (3, H, W) the numbers of reports, hits and free-space observations of each cell.

    Each of `frames` reports on the points of all others that are nearer than `reach` (H, W), metres.
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
    """Return (H, W) bool: cells whose `reach` (H, W; 0 for none) is body, according to their `votes` (3, H, W)."""
    reported, hits, through = votes
    is_body = (reach > 0.0) & ~((hits > _WORLD_SHARE * reported) & (hits >= through))
    v, u = np.nonzero(is_body)
    part, n_parts = parts_of(directions(pattern, v, u) * reach[v, u][:, None])
    reported, hits, through = (np.bincount(part, of_cells[v, u], n_parts) for of_cells in votes)
    is_body[v, u] = ((through > hits) & (through > _LEAST_SHARE * reported))[part]
    return is_body


def parts_of(points: npt.NDArray) -> tuple[npt.NDArray[np.int32], int]:
    """Return (M,) the connected part that each of `points` (M, 3) belongs to, and one more than the last part."""
    if len(points) == 0:
        return np.zeros(0, np.int32), 0
    voxels = np.floor(points / _VOXEL).astype(np.int64)
    voxels -= voxels.min(axis=0)
    grid = np.zeros(voxels.max(axis=0) + 1, np.bool_)
    grid[tuple(voxels.T)] = True
    parts, n_parts = ndimage.label(grid, np.ones((3, 3, 3), bool))
    return parts[tuple(voxels.T)], n_parts + 1
