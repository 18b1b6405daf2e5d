"""The beam pattern of a LiDAR, learnt from its own scans: a grid with about one ray in each cell.

The angles of the returns show the spacing of neighbouring firings of one beam, and the number of beams per degree at
each elevation. With both, (elevation, azimuth) maps to rows and columns, whether the beams are evenly spaced, in
blocks, few, or never repeat. Angles are those of the raw sweep, before motion compensation.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.directions import MIN_POINTS, N_DIRECTIONS, last_looks, raw_points
from automos.core.geometry import Array
from automos.core.scan import Frame, Pose

_SINE_BINS = 4096
_N_LEVELS = 5
_MICRO_ROW, _ROUGH_ROW = np.radians(0.05), np.radians(0.1)
"""Radians, height of rows far thinner than the gap between beams, and the same for rounded coordinates."""
_ELEVATION_BIN = np.radians(0.25)
_LONGEST_GAP = np.radians(2.5)
_SECTORS = 90
_UNKNOWN = np.radians(0.5)  # between rows and columns if no scan shows a pattern


class Pyramid(NamedTuple):
    """Memory layout of L levels of a grid, from fine to coarse."""

    shifts: npt.NDArray[np.int64]  # (L, 2) binary logarithms of the numbers of rows and columns in a cell
    shapes: npt.NDArray[np.int64]  # (L, 2) rows and columns of each level
    offsets: npt.NDArray[np.int64]  # (L + 1,) start of each level
    widths: npt.NDArray[np.float32]  # (L,) longer side of a cell, radians


class BeamPattern(NamedTuple):
    """The grid of rays of one LiDAR.

    Attributes
    ----------
    n_rows, n_columns : int, size of the grid; columns cover the full circle, column 0 begins at azimuth -pi.
    row_height, column_width : float, radians between neighbouring rows (the median) and columns.
    row_of_sine : (4097,) float32, row at sines of elevation evenly spaced in [-1, 1]; the centre of row k is k + 0.5.
    sweep_time : (360,) float32, time in the sweep, in [-0.5, 0.5], of directions evenly spaced in
        `cells.rough_turn_of`; zeros if directions have no fixed time.
    pyramid : Pyramid, coarser levels of the grid.
    """

    n_rows: int
    n_columns: int
    row_height: float
    column_width: float
    row_of_sine: npt.NDArray[np.float32]
    sweep_time: npt.NDArray[np.float32]
    pyramid: Pyramid


@dataclass(frozen=True, eq=False)
class EgoBody:
    """What of the vehicle or of the operator one LiDAR observes.

    `reach` (H, W) float32, metres, is the range up to which the body reaches along each ray, 0 for none; `extent`
    (S,) float32, metres, that up to which parts connected to it belong to it, for each of S sectors of azimuth.
    """

    reach: npt.NDArray[np.float32]
    extent: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Lidar:
    """What is learnt of one LiDAR: its pose in a scan's frame, its beam pattern, and the ego body that its rays meet.

    `number` counts the LiDARs of merged clouds. `body` is None where none was found.
    """

    number: int
    T_scan_sensor: Pose
    pattern: BeamPattern
    body: EgoBody | None = None


def ray_steps(lidars: list[Lidar]) -> Array:
    """Return (2,) radians between neighbouring rows and columns of rays, for the sparsest of `lidars`.

    Those without a known pattern do not count, unless all are: most have no points.
    """
    patterns = [lidar.pattern for lidar in lidars if is_known(lidar.pattern)] or [lidar.pattern for lidar in lidars]
    return np.max([(pattern.row_height, pattern.column_width) for pattern in patterns], axis=0)


@cache
def unknown_pattern() -> BeamPattern:
    """Return the pattern of a LiDAR of which nothing is known: rows and columns half a degree apart."""
    return make_pattern(np.arange(-60, 60) * _UNKNOWN, _UNKNOWN)


def is_known(pattern: BeamPattern) -> bool:
    """Whether a pattern was learnt from points."""
    return not np.array_equal(pattern.row_of_sine, unknown_pattern().row_of_sine)


def learn_pattern(frames: Iterable[Frame]) -> BeamPattern:
    """Return the beam pattern in the raw angles of `frames` (a handful of frames is enough).

    Frames with too few points are skipped; if all are, it is `unknown_pattern`.
    """
    frames = [frame for frame in frames if len(frame.points) >= MIN_POINTS]
    raw = [raw_points(frame) for frame in frames]
    times = [last_looks(points, frame.sweep_time)[0] for points, frame in zip(raw, frames, strict=True)]
    angles = [_angles(points.astype(np.float64)) for points in raw]
    if not angles:
        return unknown_pattern()
    step, kept = _azimuth_step(angles, _MICRO_ROW)
    if step is None:  # if coordinates were rounded, angles are exact only far away
        step, kept = _azimuth_step([scan[:, scan[2] > np.median(scan[2])] for scan in angles], _ROUGH_ROW)
    density, edges = _row_density(angles, step, kept)
    if not (np.isfinite(density).all() and density.sum() > 0.0):  # all points are on a line or at one place
        return unknown_pattern()
    if step is None:  # no beam repeats: use square cells with one ray in each
        step = float(np.sqrt(_ELEVATION_BIN * len(density) / density.sum()))
        density = density * step
    rows = np.concatenate([[0.0], np.cumsum(density)])
    n_rows = max(round(rows[-1]), 2)
    centres = np.interp((np.arange(n_rows) + 0.5) * rows[-1] / n_rows, rows, edges)
    return make_pattern(centres, step, next((t for t in times if t.any()), None))


def make_pattern(centres: Array, step: float, sweep_time: npt.NDArray[np.float32] | None = None) -> BeamPattern:
    """Return the grid of rows at elevations `centres` (H,), radians, and columns `step` radians apart."""
    gaps = np.maximum(np.diff(centres), 1e-4)
    padded = np.concatenate([[centres[0] - gaps[0]], centres, [centres[-1] + gaps[-1]]])
    rows = np.arange(-1, len(centres) + 1) + 0.5
    elevation = np.arcsin(np.linspace(-1.0, 1.0, _SINE_BINS + 1))
    row_of_sine = np.interp(elevation, padded, rows, left=-2.0, right=len(centres) + 2.0).astype(np.float32)
    n_columns = 8 * max(round(2.0 * np.pi / step / 8), 1)
    cell = float(np.median(gaps)), 2.0 * np.pi / n_columns
    times = np.zeros(N_DIRECTIONS, np.float32) if sweep_time is None else sweep_time
    # Columns are merged first, until cells are about square.
    lead = max(round(float(np.log2(cell[0] / cell[1]))), 0)
    shifts = np.array([[max(level - lead, 0), level] for level in range(_N_LEVELS)])
    shapes = -(-np.array([(len(centres), n_columns)]) // (1 << shifts))
    offsets = np.concatenate([[0], np.cumsum(shapes.prod(axis=1))])
    pyramid = Pyramid(shifts, shapes, offsets, ((1 << shifts) * cell).max(axis=1).astype(np.float32))
    return BeamPattern(len(centres), n_columns, *cell, row_of_sine, times, pyramid)


def directions(pattern: BeamPattern, rows: npt.NDArray, columns: npt.NDArray) -> Array:
    """Return the (M, 3) unit vectors through the centres of cells (`rows`, `columns`), sensor frame."""
    known = (pattern.row_of_sine > -1.0) & (pattern.row_of_sine < pattern.n_rows + 1.0)
    sines = np.linspace(-1.0, 1.0, len(known))[known]
    sine = np.interp(rows + 0.5, pattern.row_of_sine[known], sines)
    azimuth = 2.0 * np.pi * (columns + 0.5) / pattern.n_columns - np.pi
    cosine = np.sqrt(1.0 - sine**2)
    return np.column_stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine])


def _angles(points: Array) -> Array:
    """Return (3, M) azimuth and elevation, radians, and range of each of `points` (M, 3)."""
    x, y, z = points.T
    return np.stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)), np.linalg.norm(points, axis=1)])


def _azimuth_step(angles: list[Array], row: float) -> tuple[float | None, float]:
    """Return the radians between firings of one beam, and the share of rays that were kept in a thinned-out scan.

    None and 1 if neighbours in a row have no common spacing. `row`, radians, is the height of rows.
    """
    edges = np.geomspace(np.radians(0.02), np.radians(3.0), 101)  # 5 % wide
    best_share, step, kept = 0.4, None, 1.0
    for shift in (0.0, 0.5):  # a beam on the border of two rows would be split
        at, gaps = np.concatenate([_neighbour_gaps(scan[0], scan[1], row, shift) for scan in angles], axis=1)
        is_usual = (gaps > edges[0]) & (gaps < edges[-1])
        at, gaps = at[is_usual], gaps[is_usual]
        if len(gaps) < 100:
            continue
        around_mode = np.convolve(np.histogram(gaps, edges)[0], np.ones(5), mode="same")
        k = int(around_mode.argmax())
        share = around_mode[k] / len(gaps)
        if share > best_share:
            near_mode = (gaps > edges[max(k - 2, 0)]) & (gaps < edges[min(k + 3, 100)])
            best_share, step = share, float(np.median(gaps[near_mode]))
            # Where a whole sector returns, every second ray is missing only if the scan was thinned out.
            single, near = (np.bincount(_sector(at), gaps < limit * step, _SECTORS) for limit in (1.5, 6.5))
            kept = float(np.percentile(single[near > 0] / near[near > 0], 90))
    return step, kept


def _sector(azimuth: Array) -> npt.NDArray[np.int64]:
    return ((azimuth + np.pi) / (2.0 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS


def _neighbour_gaps(azimuth: Array, elevation: Array, row: float, shift: float) -> Array:
    """Return (2, K) azimuths and the gaps to the next ray, in rows of height `row`, all in radians."""
    micro_row = np.floor(elevation / row + shift).astype(np.int64)
    order = np.lexsort((azimuth, micro_row))
    same_row = np.diff(micro_row[order]) == 0
    return np.stack([azimuth[order][:-1], np.diff(azimuth[order])])[:, same_row]


def _row_density(angles: list[Array], step: float | None, kept: float) -> tuple[Array, Array]:
    """Return rows per elevation bin and the bins' edges; rays per radian of azimuth and bin if `step` is None."""
    low, high = min(scan[1].min() for scan in angles), max(scan[1].max() for scan in angles)
    n_bins = int((high - low) / _ELEVATION_BIN) + 1
    counts = []
    for azimuth, elevation, _ in angles:
        v = np.minimum(((elevation - low) / _ELEVATION_BIN).astype(np.int64), n_bins - 1)
        counts.append(np.bincount(v * _SECTORS + _sector(azimuth), minlength=n_bins * _SECTORS))
    per_bin = np.hstack([scan.reshape(n_bins, _SECTORS) for scan in counts]).astype(np.float64)
    full = kept * 2.0 * np.pi / _SECTORS / (step or 1.0)  # rays of one row in a full sector
    # Sky and open roads return nothing, so only sectors with returns show the density of the beams.
    density = np.array([np.percentile(c[c > 0], 75) if (c > 0).any() else 0.0 for c in per_bin])
    with np.errstate(invalid="ignore", divide="ignore"):  # the caller checks that it is finite
        density /= full
        # Motion that cannot be undone smears angles into the gaps between beams; a sector's total is unchanged.
        density *= min(1.0, _in_most(per_bin) / full / density.sum())
    # A beam apart from others is one: a lens beside the axis makes rays less steep close by, which smears it.
    for a, b in _runs(density > 0.0):
        beams = round(_in_most(per_bin[a:b]) / full)
        if beams == 1:
            density[a:b] /= density[a:b].sum()
    # Long runs of empty bins (beams into the sky) get the mean density, so that rows keep their spacing there.
    mean = density[density > 0.0].mean() * (density > 0.0).mean() if (density > 0.0).any() else 0.0
    for a, b in _runs(density == 0.0):
        if (b - a) * _ELEVATION_BIN > _LONGEST_GAP:
            density[a:b] = mean
    return density, low + _ELEVATION_BIN * np.arange(n_bins + 1)


def _in_most(bins: Array) -> float:
    """Return the rays in some bins (B, S) of a sector that is full; in a few of the S there may be more."""
    return float(np.percentile(bins.sum(axis=0), 95))


def _runs(flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Return (K, 2) the start and the end of each run of true `flags`."""
    return np.flatnonzero(np.diff(flags, prepend=False, append=False)).reshape(-1, 2)
