"""The ground of one scan as a height map, and the points that lie on it.

Each sector is followed from the sensor outwards: a cell whose lowest point continues the ground found so far is ground.
What rises faster is an object. What lies below a sight line over nearer ground is a mirror image. Occluded cells are
bridged, and a long even run at another height is accepted as ground again. The ground cells become a height map whose
gaps are filled from increasingly coarse averages. No sensor height, tilt or plane is assumed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.candidates.height_map import HeightMap, fill_gaps, sample
from automos.cells import rough_turn_of
from automos.kernels import kernel
from automos.scan import Mask
from automos.settings import GroundSettings

SECTORS = 360
"""Number of sectors around the sensor."""
START_RANGE = 10.0
"""Metres: range within which the initial height of the ground is taken."""
STEP = 0.12
"""Metres: step by which ground may rise or fall (a kerb)."""
MAX_BEND = 0.06
"""Metres per metre: greatest change of the ground's slope."""
MAX_STEP = 0.3
"""Metres: greatest difference from the expected height, at any distance."""
MAX_SLOPE = 0.35
"""Steepest ground, rise over run."""
SLOPING = 0.05
"""Rise over run of the ground around the sensor, below which sectors start level."""
PLANE_SPREAD, PLANE_ROUNDS = 0.2, 6
"""Metres from the plane around the sensor beyond which cells count little, and iterations of its fit."""
PLANE_SHARE, PLANE_LEAD = 0.5, 1.5
"""Least share of these cells on the plane, and least ratio to those at the start height: in traffic no plane fits."""
GHOST_DEPTH = 0.15
"""Metres: a point this far below the sight line over nearer ground is a mirror image."""
MAX_DEPTH = 0.3
"""Metres: points further below the surface than this are not ground."""


def find_ground(
    points_level: npt.NDArray, origin_level: npt.NDArray, settings: GroundSettings
) -> tuple[Mask, npt.NDArray[np.float32]]:
    """Return which of a scan's points are ground, and the height of all above it.

    Points far below the surface, which is uncertain beyond a crest, and points beyond `settings.max_range` are not
    ground.

    Parameters
    ----------
    points_level : (M, 3) float32, metres, level frame (z up).
    origin_level : (3,) float64, metres, position of the sensor.

    Returns
    -------
    is_ground : (M,) bool.   height : (M,) float32, metres.
    """
    origin, cell = np.asarray(origin_level, np.float64), settings.cell
    corner, surface = fit_ground(points_level, origin, settings)
    is_ground, height = np.empty(len(points_level), np.bool_), np.empty(len(points_level), np.float32)
    tolerances = (settings.tolerance, settings.tolerance_per_metre)
    _measure(points_level, origin, corner, 1.0 / cell, surface, *tolerances, is_ground, height)
    return is_ground, height


def fit_ground(
    points_level: npt.NDArray, origin: npt.NDArray[np.float64], settings: GroundSettings
) -> tuple[npt.NDArray[np.float64], HeightMap]:
    """Return the ground around the sensor as a height map; for the parameters see `find_ground`.

    Returns
    -------
    corner : (2,) float64, metres, level frame: x, y of the map's lower corner.
    surface : (H, W) float32, metres, level frame, at the centres of cells (rows along y); known everywhere.
    """
    cell, n_rings = settings.cell, int(np.ceil(settings.max_range / settings.cell))
    lowest = np.full((SECTORS, n_rings), np.float32(np.inf))
    highest = np.full_like(lowest, -np.inf)
    _fill_sectors(points_level, origin, cell, lowest, highest)
    is_ground = np.zeros(lowest.shape, np.bool_)
    _walk_outwards(lowest, highest, *_start(lowest, cell), cell, is_ground)
    # A whole number of cells, so that the map has the same cells in every scan.
    corner = (np.floor(origin[:2] / cell) - n_rings) * cell
    sums, counts = np.zeros((2, 2 * n_rings, 2 * n_rings), np.float32)
    _add_ground_points(points_level, origin, lowest, is_ground, corner, cell, sums, counts)
    return corner, fill_gaps(sums / np.maximum(counts, 1.0), np.minimum(counts, 1.0))


def _start(lowest: npt.NDArray, cell: float) -> tuple[float, npt.NDArray[np.float64]]:
    """Return the start height, a low percentile of the lowest points of all sectors near the sensor, and the slopes.

    The slope in each sector (S,) is that of the plane around the sensor, as for a vehicle on a hill.
    """
    near = lowest[:, : max(int(START_RANGE / cell), 1)]
    sectors, rings = np.nonzero(np.isfinite(near))
    level = np.zeros(len(lowest))
    if len(sectors) == 0:
        return 0.0, level
    directions = _directions(len(lowest))
    ground = np.column_stack([directions[sectors] * (cell * (rings[:, None] + 0.5)), np.ones(len(rings))])
    heights, weights = near[sectors, rings].astype(np.float64), np.ones(len(sectors))
    for _ in range(PLANE_ROUNDS):
        weighted = ground * weights[:, None]
        plane = np.linalg.lstsq(weighted.T @ ground, weighted.T @ heights, rcond=None)[0]
        weights = (1.0 + ((heights - ground @ plane) / PLANE_SPREAD) ** 2) ** -2
    lows = near.min(axis=1)
    start = float(np.percentile(lows[np.isfinite(lows)], 30))
    on_plane, on_level = (np.count_nonzero(np.abs(heights - z) < STEP) for z in (ground @ plane, start))
    is_plane = on_plane > max(PLANE_SHARE * len(heights), PLANE_LEAD * on_level)
    if is_plane and SLOPING < np.hypot(*plane[:2]) < MAX_SLOPE:
        return float(plane[2]), directions @ plane[:2]
    return start, level


def _directions(n_sectors: int) -> npt.NDArray[np.float64]:
    """Return (S, 2) the unit vector through the middle of each sector, see `_sector_and_ring`."""
    turn = (np.arange(n_sectors) + 0.5) / n_sectors - 0.5
    x = 1.0 - 4.0 * np.abs(turn)
    y = np.sign(turn) * (1.0 - np.abs(x))
    return np.column_stack([x, y]) / np.hypot(x, y)[:, None]


@kernel
def _sector_and_ring(x, y, n_sectors, n_rings, ring):  # type: ignore[no-untyped-def]
    """Sector and ring of an offset; the ring is `n_rings` for everything farther out, and for NaN."""
    far = np.sqrt(x * x + y * y) / ring
    if not far < n_rings:  # compared as float, because huge numbers overflow integers
        return 0, n_rings
    return int(rough_turn_of(x, y) * n_sectors), int(far)


@kernel
def _fill_sectors(points, origin, ring, lowest, highest):  # type: ignore[no-untyped-def]
    """Write the heights above the sensor of the lowest and highest point per sector and ring."""
    n_sectors, n_rings = lowest.shape
    for i in range(len(points)):
        j, k = _sector_and_ring(points[i, 0] - origin[0], points[i, 1] - origin[1], n_sectors, n_rings, ring)
        if k < n_rings:
            z = points[i, 2] - origin[2]
            lowest[j, k] = min(lowest[j, k], z)
            highest[j, k] = max(highest[j, k], z)


@kernel
def _walk_outwards(lowest, highest, start, slopes, ring, is_ground):  # type: ignore[no-untyped-def]
    """Mark the cells that continue the ground found so far."""
    n_sectors, n_rings = lowest.shape
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
            sight = max(sight, (low - GHOST_DEPTH) / r)


@kernel
def _add_ground_points(points, origin, lowest, is_ground, corner, cell, sums, counts):  # type: ignore[no-untyped-def]
    """Add the height of each point just above ground cells to its cell of the map."""
    n_sectors, n_rings = lowest.shape
    h, w = sums.shape
    for i in range(len(points)):
        j, k = _sector_and_ring(points[i, 0] - origin[0], points[i, 1] - origin[1], n_sectors, n_rings, cell)
        if k >= n_rings or not is_ground[j, k] or points[i, 2] - origin[2] - lowest[j, k] > STEP:
            continue
        u, v = int((points[i, 0] - corner[0]) / cell), int((points[i, 1] - corner[1]) / cell)
        if 0 <= u < w and 0 <= v < h:
            sums[v, u] += points[i, 2]
            counts[v, u] += 1


@kernel
def _measure(points, origin, corner, per_cell, surface, tolerance, tolerance_per_metre, is_ground, height):  # type: ignore[no-untyped-def]
    """Write which points are on the `surface`, and their heights above it."""
    h, w = surface.shape
    for i in range(len(points)):
        u, v = (points[i, 0] - corner[0]) * per_cell, (points[i, 1] - corner[1]) * per_cell
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        beneath = sample(surface, u - 0.5, v - 0.5)
        is_low = -MAX_DEPTH < points[i, 2] - beneath < tolerance + tolerance_per_metre * np.sqrt(x * x + y * y)
        is_ground[i] = is_low and 0.0 <= u < w and 0.0 <= v < h
        height[i] = points[i, 2] - np.float32(beneath)
