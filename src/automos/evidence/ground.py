"""The ground of one scan as a height map, and the points that lie on it.

Each sector is followed from the sensor outwards: a cell whose lowest point continues the ground found so far is ground.
What rises faster is an object. What lies below a sight line over nearer ground is a mirror image. Occluded cells are
bridged, and a long even run at another height is accepted as ground again. Ground lies: where hardly any sector has
flat cells at two ranges, these are the feet of walls, people and boats, and no ground is seen. The others become a
height map whose gaps are filled from increasingly coarse averages (pull-push). No sensor height, tilt or plane is
assumed.
"""

import numpy as np
import numpy.typing as npt

from automos.core.cells import rough_turn_of
from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import Mask
from automos.evidence.height_map import MAX_STEP, SECTORS, GroundMap, above_ground
from automos.settings import GroundSettings

START_RANGE = 10.0  # metres: range within which the initial height of the ground is taken
STEP = 0.12  # metres: step by which ground may rise or fall (a kerb)
MAX_BEND = 0.06  # metres per metre: greatest change of the ground's slope
MAX_SLOPE = 0.35  # steepest ground, rise over run
PLANE_SPREAD, PLANE_ROUNDS = 0.2, 6
"""Metres from the plane around the sensor beyond which cells count little, and iterations of its fit."""
PLANE_LEAD = 1.5
"""Least ratio of the cells on that plane, which are most, to those at the start height: in traffic no plane fits."""
LYING, BESIDE = 0.1, 15
"""Least share of sectors, of all and of those that many sectors beside one, in which ground lies at two ranges: it is
flat there, and not the feet of things that stand on what is not seen."""


def find_ground(points_level: npt.NDArray, origin_level: Array, settings: GroundSettings) -> tuple[Mask, npt.NDArray]:
    """Return which of a scan's points are ground, and the height of all above it.

    Points far below the surface, which is uncertain beyond a crest, and points beyond `settings.max_range` are not
    ground. Where no ground is seen at all, none is, and heights are those above the lowest points.

    Parameters
    ----------
    points_level : (M, 3) float32, metres, level frame (z up).
    origin_level : (3,) float64, metres, position of the sensor.

    Returns
    -------
    is_ground : (M,) bool.   height : (M,) float32, metres.
    """
    return above_ground(map_ground(points_level, origin_level, settings), points_level, settings)


def map_ground(points_level: npt.NDArray, origin_level: Array, settings: GroundSettings) -> GroundMap:
    """Return the ground of a scan; see `find_ground`."""
    origin, cell = np.asarray(origin_level, np.float64), settings.cell
    n_rings = int(np.ceil(settings.max_range / cell))
    lowest, highest = _fill_sectors(points_level, origin, cell, n_rings)
    is_ground = _walk_outwards(lowest, highest, *_start(lowest, cell), cell)
    is_seen = _sees_ground(is_ground, is_ground & (highest - lowest < STEP))
    is_ground &= is_seen[:, None]
    # A whole number of cells, so that the map has the same cells in every scan.
    corner = (np.floor(origin[:2] / cell) - n_rings) * cell
    sums, counts = (grid.ravel() for grid in _add_ground_points(points_level, origin, lowest, is_ground, corner, cell))
    cells, bottom = np.flatnonzero(counts), origin[2] + lowest.min(where=np.isfinite(lowest), initial=0.0)
    is_seen, heights = is_seen & is_ground.any(), sums[cells] / counts[cells]
    sight = _sight_lines(lowest, is_ground, cell)
    return GroundMap(origin, corner, cell, 2 * n_rings, cells, heights, is_seen, bottom, sight)


def _sight_lines(lowest: npt.NDArray, is_ground: Mask, cell: float) -> npt.NDArray[np.float16]:
    """Return (S, R) the slope of the lowest ray that passes over each ring to ground beyond."""
    slopes = np.where(is_ground, lowest, np.inf) / (cell * (np.arange(lowest.shape[1]) + 0.5))
    lowest_from_here_on = np.minimum.accumulate(slopes[:, ::-1], axis=1)[:, ::-1]
    return np.pad(lowest_from_here_on[:, 1:], ((0, 0), (0, 1)), constant_values=np.inf).astype(np.float16)


def _start(lowest: npt.NDArray, cell: float) -> tuple[float, Array]:
    """Return the start height, a low percentile of the lowest points of all sectors near the sensor, and the slopes.

    The slope in each sector (S,) is that of the plane around the sensor, as for a vehicle on a hill.
    """
    near = lowest[:, : max(int(START_RANGE / cell), 1)]
    sectors, rings = np.nonzero(np.isfinite(near))
    level = np.zeros(SECTORS)
    if len(sectors) == 0:
        return 0.0, level
    directions = _directions()
    ground = np.column_stack([directions[sectors] * (cell * (rings[:, None] + 0.5)), np.ones(len(rings))])
    heights, weights = near[sectors, rings].astype(np.float64), np.ones(len(sectors))
    for _ in range(PLANE_ROUNDS):
        weighted = ground * weights[:, None]
        plane = np.linalg.lstsq(weighted.T @ ground, weighted.T @ heights, rcond=None)[0]
        weights = (1.0 + ((heights - ground @ plane) / PLANE_SPREAD) ** 2) ** -2
    lows = near.min(axis=1)
    start = float(np.percentile(lows[np.isfinite(lows)], 30))
    on_plane, on_level = (np.count_nonzero(np.abs(heights - z) < STEP) for z in (ground @ plane, start))
    is_plane = on_plane > max(0.5 * len(heights), PLANE_LEAD * on_level)
    if is_plane and np.hypot(*plane[:2]) < MAX_SLOPE:
        return float(plane[2]), directions @ plane[:2]
    return start, level


def _sees_ground(is_ground: Mask, is_lying: Mask) -> Mask:
    """Return the sectors (S,) beside which enough of those with ground have some that lies at two ranges or more."""
    found = np.array([is_lying.sum(axis=1) > 1, is_ground.any(axis=1)], np.float64)
    if found[0].sum() < LYING * found[1].sum():
        return np.zeros(SECTORS, np.bool_)
    around = np.cumsum(np.concatenate([found, found, found], axis=1), axis=1)
    here = np.arange(SECTORS, 2 * SECTORS)
    lying, some = around[:, here + BESIDE] - around[:, here - BESIDE - 1]
    return (lying >= LYING * some) & (lying > 0.0)


def _directions() -> Array:
    """Return (S, 2) the unit vector through the middle of each sector, see `_sector_and_ring`."""
    turn = (np.arange(SECTORS) + 0.5) / SECTORS - 0.5
    x = 1.0 - 4.0 * np.abs(turn)
    y = np.sign(turn) * (1.0 - np.abs(x))
    return np.column_stack([x, y]) / np.hypot(x, y)[:, None]


@kernel
def _sector_and_ring(x, y, n_rings, ring):  # type: ignore[no-untyped-def]
    """Sector and ring of an offset; the ring is `n_rings` for everything farther out, and for NaN."""
    far = np.sqrt(x * x + y * y) / ring
    if not far < n_rings:  # compared as float, because huge numbers overflow integers
        return 0, n_rings
    return int(rough_turn_of(x, y) * SECTORS), int(far)


@kernel
def _fill_sectors(points, origin, ring, n_rings):  # type: ignore[no-untyped-def]
    """Return the heights above the sensor of the lowest and highest point per sector and ring."""
    lowest = np.full((SECTORS, n_rings), np.float32(np.inf))
    highest = np.full((SECTORS, n_rings), np.float32(-np.inf))
    for i in range(len(points)):
        j, k = _sector_and_ring(points[i, 0] - origin[0], points[i, 1] - origin[1], n_rings, ring)
        if k < n_rings:
            z = points[i, 2] - origin[2]
            lowest[j, k] = min(lowest[j, k], z)
            highest[j, k] = max(highest[j, k], z)
    return lowest, highest


@kernel
def _walk_outwards(lowest, highest, start, slopes, ring):  # type: ignore[no-untyped-def]
    """Return the cells that continue the ground found so far."""
    n_sectors, n_rings = lowest.shape
    is_ground = np.zeros((n_sectors, n_rings), np.bool_)
    for j in range(n_sectors):
        z, slope, r_last = start, slopes[j], 0.0
        sight = -np.inf  # steepest sight line over the ground so far; what lies below is a mirror image
        run = 0  # successive cells that continue each other but not the ground: a hidden rise, a step, a ramp
        z_run, r_run = 0.0, 0.0
        for k in range(n_rings):
            if not np.isfinite(lowest[j, k]):
                continue
            r = ring * (k + 0.5)
            low = lowest[j, k]
            if low < r * sight:
                continue
            ahead = r - r_last
            expected = z + slope * ahead
            rise = min(STEP + MAX_BEND * ahead, MAX_STEP)
            fall = STEP + MAX_SLOPE * ahead  # only ground lies below the ground, so this limit is wider
            if not expected - fall <= low <= expected + rise:
                is_flat = highest[j, k] - low < 2.0 * STEP
                follows = run > 0 and abs(low - z_run) <= STEP + MAX_SLOPE * (r - r_run) and r - r_run < 10.0 * ring
                run = (run + 1 if follows else 1) if is_flat else 0
                z_run, r_run = low, r
                if run < 5 or abs(low - expected) > fall:
                    continue
            run = 0
            is_ground[j, k] = True
            new_slope = min(max((low - z) / max(ahead, 4.0 * ring), -MAX_SLOPE), MAX_SLOPE)
            weight = min(ahead / 4.0, 0.5)
            slope = (1.0 - weight) * slope + weight * new_slope if r_last > 0.0 else slopes[j]
            z, r_last = low, r
            sight = max(sight, (low - STEP) / r)
    return is_ground


@kernel
def _add_ground_points(points, origin, lowest, is_ground, corner, cell):  # type: ignore[no-untyped-def]
    """Return the sums and numbers of the heights of points just above ground cells, for each cell of the map."""
    n_rings = lowest.shape[1]
    w = 2 * n_rings
    sums, counts = np.zeros((w, w), np.float32), np.zeros((w, w), np.float32)
    for i in range(len(points)):
        j, k = _sector_and_ring(points[i, 0] - origin[0], points[i, 1] - origin[1], n_rings, cell)
        if k >= n_rings or not is_ground[j, k] or points[i, 2] - origin[2] - lowest[j, k] > STEP:
            continue
        u, v = int((points[i, 0] - corner[0]) / cell), int((points[i, 1] - corner[1]) / cell)
        if 0 <= u < w and 0 <= v < w:
            sums[v, u] += points[i, 2]
            counts[v, u] += 1
    return sums, counts
