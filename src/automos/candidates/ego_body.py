"""The vehicle's own body: what stays in the sensor's frame while the world goes by.

A ray that meets the body meets it in every scan at the same range. So may a ray that meets an even road, a vehicle that
keeps its distance, or the long side of one that drives along. But the road is also there when it is looked at from
elsewhere, before and after, and a body is not: what stays in the sensor's frame and in the world is the world.
And nobody drives beside another to the sensor's noise: a thing's edges and ranges must be in the last third of the
recording where they were in the first. What nearly always returns from within arm's reach (legs, an operator)
rides along, however it moves. What hangs together with the body in a scan (a trailer in a bend) belongs to it. Where
the sensor stands still nothing can be told, and nothing goes wrong: what never moves is static.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy import ndimage

from automos.candidates.ego_body_ranges import cell_of, find_constant, find_near, nearest_ranges
from automos.candidates.free_space_image import make_image, project, pyramid_shape
from automos.candidates.free_space_pattern import BeamPattern, directions, raw_points
from automos.candidates.free_space_vote import EDGE, HIT, look_through
from automos.geometry import inverse
from automos.scan import OBJECT, Frame, Frames, Mask, Points
from automos.settings import EgoBodySettings

_LOOKS = 16
"""Scans that are asked whether the world is where a body may be."""
_ASKED = 20_000
"""Points of a scan, at most, about which they are asked."""
_VOXEL = 0.3
"""Metres: points in neighbouring voxels hang together."""
STEADIEST = 25
MAX_SCANS = 40
"""Scans looked at, spread over the recording."""
MIN_SCANS = 9
"""With fewer scans apart from each other nothing is called body."""
MIN_DISTANCE = 0.5
"""Metres: how far apart the sensor must be in scans looked at."""
MIN_OVERLAP = 0.8
"""Share of a part at the ends of the recording that must be there at both."""
MAX_DRIFT = 0.025
"""Metres: of a part's range from the first third of the recording to the last."""
BEYOND = 0.5
"""M beyond the body's reach from which what is seen shows the world."""
WORLD_DISTANCE = 0.25
"""M between a place and what is seen there from elsewhere."""
WORLD_SHARE = 0.05
"""Share of hits among such looks that make it the world's."""
MIN_CELLS = 4
"""Neighbouring rays that a part of the body must be met by."""
ATTACHED_SHARE = 0.15
"""Of what hangs together within the body\'s reach, the share that must be on it for all to be."""
"""Percentile of a part's drift that counts: what hangs on a hinge is steady beside it, traffic is so nowhere."""


@dataclass(frozen=True, eq=False)
class EgoBody:
    """How far the vehicle's own body reaches along each ray of the sensor.

    Attributes
    ----------
    reach : (H, W) float32, metres, on the pattern's grid; 0 where the body is not in the way.
    pattern : the grid.
    """

    reach: npt.NDArray[np.float32]
    pattern: BeamPattern

    def covers(self, points: Points, is_ground: Mask | None = None) -> Mask:
        """Return (M,) bool: which of `points` (M, 3) of a raw sweep, sensor frame, lie on the body or hang on it.

        Ground, (M,) bool, is what nothing hangs together by.
        """
        cell = np.full(len(points), -1, np.int64)
        _cells_within(points, self.pattern.row_of_sine, self.reach, cell)
        is_body = cell >= 0
        if is_body.any():
            is_ground = np.zeros_like(is_body) if is_ground is None else is_ground
            _attach(points, is_body, is_ground, float(self.reach.max()))
        return is_body


def nobody(pattern: BeamPattern) -> EgoBody:
    """Return the body of a sensor that none is in the way of."""
    return EgoBody(np.zeros((pattern.n_rows, pattern.n_columns), np.float32), pattern)


def find_ego_body(frames: Frames, pattern: BeamPattern, settings: EgoBodySettings, threads: int = 2) -> EgoBody:
    """Return the body that a handful of `frames`, spread over the recording, show."""
    shape = (pattern.n_rows, pattern.n_columns)
    sample = _scans_apart(frames)
    origins = frames.T_level_sensor[sample, :3, 3]
    # Nearer than half the way, all of the world is looked at from elsewhere at some time.
    max_range = min(settings.max_range, 0.5 * float(np.linalg.norm(np.ptp(origins, axis=0))))
    if len(sample) < MIN_SCANS or max_range < settings.near_reach:
        return nobody(pattern)
    with ThreadPoolExecutor(threads) as pool:
        ranges = np.stack(list(pool.map(lambda i: nearest_ranges(frames[i], pattern, max_range), sample)))
    ends, slack, near = np.zeros((3, 2, *shape), np.float32)
    for k, part in enumerate(np.array_split(ranges, 3)[::2]):
        ends[k], slack[k] = find_constant(part, settings)
        find_near(part, settings.near_reach, settings.min_share, near[k])
    near = np.where((near > 0.0).all(axis=0), near.max(axis=0), np.float32(0.0))
    asked = [sample[i] for i in np.unique(np.linspace(0, len(sample) - 1, _LOOKS).astype(int))]
    is_world = _is_in_world([frames[i] for i in asked], pattern, np.maximum(ends.max(axis=0), near))
    ends[:, is_world], near[is_world] = 0.0, 0.0
    reach = np.maximum(np.where(_stays_put(ends, slack.max(axis=0), pattern, settings), ends.max(axis=0), 0.0), near)
    reach = np.where(is_world, 0.0, _grow(reach)).astype(np.float32)
    return EgoBody(reach, pattern)


def _scans_apart(frames: Frames) -> list[int]:
    """Return up to `max_scans` of `frames`, evenly spread, each some way from the one before."""
    origins = frames.T_level_sensor[:, :3, 3]
    sample: list[int] = []
    for i in np.unique(np.linspace(0, len(frames) - 1, 2 * MAX_SCANS).astype(int)):
        if not sample or np.linalg.norm(origins[i] - origins[sample[-1]]) > MIN_DISTANCE:
            sample.append(int(i))
    return [sample[i] for i in np.unique(np.linspace(0, len(sample) - 1, MAX_SCANS).astype(int))]


def _stays_put(
    ends: npt.NDArray[np.float32], slack: npt.NDArray[np.float32], pattern: BeamPattern, settings: EgoBodySettings
) -> Mask:
    """Return (H, W) bool: connected parts that are in the same place in both `ends` (2, H, W; 0 where not there).

    How far the parts have drifted is measured by `slack` (H, W), metres, the exactness of each ray's range.
    """
    is_there = ends > 0.0
    v, u = np.nonzero(is_there.any(axis=0))
    is_part = np.zeros(is_there.shape[1:], np.bool_)
    if len(v) == 0:
        return is_part
    part, n_parts = _parts_of(directions(pattern, v, u) * ends[:, v, u].max(axis=0)[:, None])
    # A cell to each side is allowed for: edges are hit and missed by turns.
    in_both = np.all([ndimage.binary_dilation(end, np.ones((3, 3), bool)) for end in is_there], axis=0)[v, u]
    size = np.bincount(part, minlength=n_parts)
    overlap = np.bincount(part, in_both, n_parts) / np.maximum(size, 1)
    drift = np.where(is_there[:, v, u].all(axis=0), np.ptp(ends[:, v, u], axis=0), np.nan)
    drift *= settings.tolerance / np.maximum(slack[v, u], settings.tolerance)
    is_body = (overlap >= MIN_OVERLAP) & (size >= MIN_CELLS)
    for k in np.flatnonzero(is_body):
        of_part = drift[part == k]
        of_part = of_part[np.isfinite(of_part)]
        is_body[k] = len(of_part) > 0 and np.percentile(of_part, STEADIEST) <= MAX_DRIFT
    is_part[v, u] = is_body[part]
    return is_part


def _parts_of(points: npt.NDArray) -> tuple[npt.NDArray[np.int32], int]:
    """Return (M,) which part each of `points` (M, 3), at least one, belongs to, and one more than the last of them."""
    voxels = np.floor(points / _VOXEL).astype(np.int64)
    voxels -= voxels.min(axis=0)
    grid = np.zeros(voxels.max(axis=0) + 1, np.bool_)
    grid[tuple(voxels.T)] = True
    parts, n_parts = ndimage.label(grid, np.ones((3, 3, 3), bool))
    return parts[tuple(voxels.T)], n_parts + 1


def _is_in_world(frames: list[Frame], pattern: BeamPattern, reach: npt.NDArray[np.float32]) -> Mask:
    """Return (H, W) bool: cells at whose points other `frames`, from elsewhere, hit something again.

    Who drives behind comes by there, too; but then the place is seen through more often than it is hit.
    """
    pyramid, n_cells = pyramid_shape(pattern), reach.size
    raws = [raw_points(frame) for frame in frames]
    images = [
        make_image(project(raw, np.ones(len(raw), np.bool_), pattern), np.full(len(raw), OBJECT, np.uint8), pyramid)
        for raw in raws
    ]
    tolerances = tuple(np.float32(x) for x in (0.2, 0.005, WORLD_DISTANCE, 0.01, 0.2))
    hits, told, through = np.zeros((3, n_cells))
    for frame, raw in zip(frames, raws, strict=True):
        cell = np.full(len(raw), -1, np.int64)
        _cells_within(raw, pattern.row_of_sine, reach, cell)
        rows = np.flatnonzero(cell >= 0)
        rows = rows[:: max(len(rows) // _ASKED, 1)]
        points = np.ascontiguousarray(np.take(frame.points, rows, axis=0).T)
        codes, (ranges, misses) = np.empty(len(rows), np.uint8), np.empty((2, len(rows)), np.float32)
        for other, image in zip(frames, images, strict=True):
            T = inverse(other.T_level_sensor) @ frame.T_level_sensor
            if np.linalg.norm(T[:3, 3]) < MIN_DISTANCE:
                continue
            motion = np.zeros(6) if other.sweep_motion is None or other.sweep_time is None else other.sweep_motion
            scan = (np.asarray(motion, np.float32), pattern, pyramid, image)
            look_through(points, T[:3].astype(np.float32), *scan, tolerances, codes, ranges, misses)
            is_far = ranges > float(reach.max()) + BEYOND
            hits += np.bincount(cell[rows], is_far & (codes == HIT), n_cells)
            told += np.bincount(cell[rows], is_far & (codes >= EDGE), n_cells)
            through += np.bincount(cell[rows], is_far & (codes > HIT), n_cells)
    return ((hits > WORLD_SHARE * told) & (hits >= through) & (hits > 0)).reshape(reach.shape)


def _attach(points: Points, is_body: Mask, is_ground: Mask, reach: float) -> None:
    """Mark in `is_body` (M,) the points near the sensor that hang together with enough of what is marked."""
    near = np.flatnonzero((np.einsum("ij,ij->i", points, points) < reach**2) & (is_body | ~is_ground))
    if len(near) == 0:
        return
    part, n_parts = _parts_of(points[near])
    total, on_body = np.bincount(part, minlength=n_parts), np.bincount(part, is_body[near], n_parts)
    is_body[near] |= (on_body >= ATTACHED_SHARE * total)[part]


def _grow(reach: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return `reach` grown by one cell to each side: the body's edges are hit and missed by turns."""
    rows = np.maximum(reach, np.maximum(np.pad(reach[1:], ((0, 1), (0, 0))), np.pad(reach[:-1], ((1, 0), (0, 0)))))
    return np.maximum(rows, np.maximum(np.roll(rows, 1, axis=1), np.roll(rows, -1, axis=1)))


@numba.njit(cache=True, nogil=True)
def _cells_within(points, row_of_sine, reach, cell):  # type: ignore[no-untyped-def]
    """Write the cell (row times columns plus column) of each point nearer than its cell's reach."""
    h, w = reach.shape
    farthest = reach.max()
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if x * x + y * y + z * z < farthest * farthest:
            r, v, u = cell_of(x, y, z, row_of_sine, h, w)
            if v >= 0 and r < reach[v, u]:
                cell[i] = v * w + u
