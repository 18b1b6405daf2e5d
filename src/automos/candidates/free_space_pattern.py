"""The beam pattern of a sensor, learnt from its own scans.

The angles of the returns show the spacing of neighbouring firings of one beam, and the number of beams per degree at
each elevation. With both, (elevation, azimuth) maps to a grid of rows and columns with about one ray in each cell,
whether the beams are evenly spaced, in blocks, few, or never repeat. Angles are those of the raw sweep, before motion
compensation.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_grid import BeamPattern, make_pattern
from automos.candidates.free_space_sweep import MIN_POINTS, last_looks, raw_points
from automos.scan import Frame

Array = npt.NDArray[np.float64]
_MICRO_ROW, _ROUGH_ROW = np.radians(0.05), np.radians(0.1)
"""Radians, height of rows far thinner than the gap between beams, and the same for rounded coordinates."""
_ELEVATION_BIN = np.radians(0.25)
_LONGEST_GAP = np.radians(2.5)
_SECTORS = 90
_UNKNOWN = np.radians(0.5)
"""Radians between rows and columns if no scan shows a pattern."""


def learn_pattern(frames: Iterable[Frame]) -> BeamPattern:
    """Return the beam pattern in the raw angles of `frames` (a handful of frames is enough).

    Frames with too few points are skipped; if all are, rows and columns are half a degree apart.
    """
    frames = [frame for frame in frames if len(frame.points) >= MIN_POINTS]
    raw = [raw_points(frame) for frame in frames]
    times = [last_looks(points, frame.sweep_time)[0] for points, frame in zip(raw, frames, strict=True)]
    angles = [_angles(points.astype(np.float64)) for points in raw]
    if not angles:
        return _unknown_pattern()
    step, kept = _azimuth_step(angles, _MICRO_ROW)
    if step is None:  # if coordinates were rounded, angles are exact only far away
        step, kept = _azimuth_step([scan[:, scan[2] > np.median(scan[2])] for scan in angles], _ROUGH_ROW)
    density, edges = _row_density(angles, step, kept)
    if not (np.isfinite(density).all() and density.sum() > 0.0):  # all points are on a line or at one place
        return _unknown_pattern()
    if step is None:  # no beam repeats: use square cells with one ray in each
        step = float(np.sqrt(_ELEVATION_BIN * len(density) / density.sum()))
        density = density * step
    rows = np.concatenate([[0.0], np.cumsum(density)])
    n_rows = max(round(rows[-1]), 2)
    centres = np.interp((np.arange(n_rows) + 0.5) * rows[-1] / n_rows, rows, edges)
    return make_pattern(centres, step, next((t for t in times if t.any()), None))


def _unknown_pattern() -> BeamPattern:
    return make_pattern(np.arange(-60, 60) * _UNKNOWN, _UNKNOWN)


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
        density *= min(1.0, np.percentile(per_bin.sum(axis=0), 95) / full / density.sum())
    _fill_silent_bins(density)
    return density, low + _ELEVATION_BIN * np.arange(n_bins + 1)


def _fill_silent_bins(density: Array) -> None:
    """Give long runs of empty bins (beams into the sky) the mean density, so that rows keep their spacing there."""
    is_empty = np.concatenate([[False], density == 0.0, [False]])
    starts, ends = np.flatnonzero(np.diff(is_empty.astype(np.int8))).reshape(-1, 2).T
    mean = density[density > 0.0].mean() * (density > 0.0).mean() if (density > 0.0).any() else 0.0
    for a, b in zip(starts, ends, strict=True):
        if (b - a) * _ELEVATION_BIN > _LONGEST_GAP:
            density[a:b] = mean
