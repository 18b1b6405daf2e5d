"""Where a sensor's beams point, learnt from its own scans.

Every sensor leaves its pattern in the angles of its returns: how far apart neighbouring firings of one beam are, and
how many beams there are per degree at each elevation. With both, (elevation, azimuth) maps to a grid of rows and
columns in which about one ray falls into each cell, whether the beams are evenly spaced, in blocks, few, or never
repeat. Angles are those of the raw sweep, before the sensor's motion is taken out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from automos.geometry import se3_exp
from automos.scan import Frame, Points

_SINE_BINS = 4096
_MIN_POINTS = 100
_TIME_BINS = 360
_MICRO_ROW = np.radians(0.05)
_ELEVATION_BIN = np.radians(0.25)
_LONGEST_GAP = np.radians(2.5)
_SECTORS = 90


class BeamPattern(NamedTuple):
    """The grid of rays of one sensor.

    Attributes
    ----------
    n_rows, n_columns : size of the grid; columns go round the full circle, column 0 begins at azimuth -pi.
    row_height, column_width : radians between neighbouring rows (the median) and columns.
    row_of_sine : (4097,) float32, row at sines of elevation evenly spaced in [-1, 1]; the k-th row's centre is k + 0.5.
    sweep_time : (360,) float32, when in the sweep [-0.5, 0.5] the sensor looks along directions evenly spaced in
        `rough_turn_of`; zeros where directions have no fixed time.
    """

    n_rows: int
    n_columns: int
    row_height: float
    column_width: float
    row_of_sine: npt.NDArray[np.float32]
    sweep_time: npt.NDArray[np.float32]


def raw_points(frame: Frame) -> Points:
    """Return (M, 3) float32: the frame's points as the moving sensor saw them, motion compensation taken back."""
    if frame.sweep_time is None or frame.sweep_motion is None:
        return frame.points
    # Sweeps turn by a few degrees at most: with 64 steps the rounding stays under a centimetre at 50 m.
    n_steps = 64
    steps = (np.arange(n_steps) + 0.5) / n_steps - 0.5
    T_raw_frame = se3_exp(-steps[:, None] * frame.sweep_motion).astype(np.float32)
    out = np.empty_like(frame.points)
    _transform_by_step(frame.points, frame.sweep_time, T_raw_frame, out)
    return out


def directions(pattern: BeamPattern, rows: npt.NDArray, columns: npt.NDArray) -> npt.NDArray[np.float64]:
    """Return the (M, 3) unit vectors through the middles of cells (`rows`, `columns`), sensor frame."""
    known = (pattern.row_of_sine > -1.0) & (pattern.row_of_sine < pattern.n_rows + 1.0)
    sines = np.linspace(-1.0, 1.0, len(known))[known]
    sine = np.interp(rows + 0.5, pattern.row_of_sine[known], sines)
    azimuth = 2.0 * np.pi * (columns + 0.5) / pattern.n_columns - np.pi
    cosine = np.sqrt(1.0 - sine**2)
    return np.column_stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine])


@numba.njit(cache=True, nogil=True)
def turn_of(x, y):  # type: ignore[no-untyped-def]
    """Return the azimuth of (x, y) as a share of the full turn, in [0, 1): 0 at -pi. Exact to 1e-5 of a radian."""
    ax, ay = abs(x), abs(y)
    a = min(ax, ay) / max(max(ax, ay), np.float32(1e-9))
    s = a * a
    angle = np.float32(-0.01172120) * s + np.float32(0.05265332)
    angle = angle * s - np.float32(0.11643287)
    angle = angle * s + np.float32(0.19354346)
    angle = angle * s - np.float32(0.33262347)
    angle = (angle * s + np.float32(0.99997726)) * a
    angle = np.float32(1.5707964) - angle if ay > ax else angle
    angle = np.float32(3.1415927) - angle if x < np.float32(0.0) else angle
    angle = -angle if y < np.float32(0.0) else angle
    return min(max(angle * np.float32(0.15915494) + np.float32(0.5), np.float32(0.0)), np.float32(0.9999999))


@numba.njit(cache=True, nogil=True)
def rough_turn_of(x, y):  # type: ignore[no-untyped-def]
    """Return a number in [0, 1) that grows with the azimuth of (x, y) from -pi on; cheaper than `turn_of`."""
    share = np.float32(0.25) * (np.float32(1.0) - x / max(abs(x) + abs(y), np.float32(1e-9)))  # 0 ahead, 0.5 behind
    turn = np.float32(0.5) + share if y >= np.float32(0.0) else np.float32(0.5) - share
    return min(turn, np.float32(0.9999999))


def learn_pattern(frames: Iterable[Frame]) -> BeamPattern:
    """Return the beam pattern that the raw angles of `frames` show (a handful of frames is enough).

    Frames of hardly a point show none; where all are like that, rows and columns are half a degree apart.
    """
    azimuths, elevations, times = [], [], []
    for frame in frames:
        if len(frame.points) < _MIN_POINTS:
            continue
        points = raw_points(frame).astype(np.float64)
        azimuths.append(np.arctan2(points[:, 1], points[:, 0]))
        elevations.append(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
        times.append(frame.sweep_time)
    if not azimuths:
        half_degree = np.radians(0.5)
        return _make_pattern(np.arange(-60, 60) * half_degree, half_degree, np.zeros(_TIME_BINS, np.float32))
    step, kept = _azimuth_step(azimuths, elevations)
    density, edges = _row_density(
        azimuths, elevations, step, kept
    )  # rows per bin, for one ray per row and azimuth step
    if step is None:  # no beam repeats: square cells, one ray in each
        step = float(np.sqrt(_ELEVATION_BIN * len(density) / density.sum()))
        density = density * step
    rows = np.concatenate([[0.0], np.cumsum(density)])
    n_rows = max(round(rows[-1]), 2)
    centres = np.interp((np.arange(n_rows) + 0.5) * rows[-1] / n_rows, rows, edges)
    return _make_pattern(centres, step, _time_of_direction(azimuths, times))


def _azimuth_step(azimuths: list[npt.NDArray], elevations: list[npt.NDArray]) -> tuple[float | None, float]:
    """Return the radians between firings of one beam and the share of rays that were kept in a thinned-out scan.

    None and 1 where neighbours in a row keep no common distance.
    """
    edges = np.geomspace(np.radians(0.02), np.radians(3.0), 101)  # 5 % wide
    best_share, step, kept = 0.0, None, 1.0
    for shift in (0.0, 0.5):  # a beam on the border of two rows would be torn apart
        parts = [_neighbour_gaps(a, e, shift) for a, e in zip(azimuths, elevations, strict=True)]
        at, gaps = np.concatenate(parts, axis=1)
        is_usual = (gaps > edges[0]) & (gaps < edges[-1])
        at, gaps = at[is_usual], gaps[is_usual]
        if len(gaps) < 100:
            continue
        around_mode = np.convolve(np.histogram(gaps, edges)[0], np.ones(5), mode="same")
        k = int(around_mode.argmax())
        share = around_mode[k] / len(gaps)
        if share > max(best_share, 0.4):
            near_mode = (gaps > edges[max(k - 2, 0)]) & (gaps < edges[min(k + 3, 100)])
            best_share, step = share, float(np.median(gaps[near_mode]))
            # Where a whole sector returns, every second ray is missing only if they were taken out.
            sector = ((at + np.pi) / (2.0 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
            single = np.bincount(sector, gaps < 1.5 * step, _SECTORS)
            near = np.bincount(sector, gaps < 6.5 * step, _SECTORS)
            kept = float(np.percentile(single[near > 0] / near[near > 0], 90))
    return step, kept


def _neighbour_gaps(azimuth: npt.NDArray, elevation: npt.NDArray, shift: float) -> npt.NDArray:
    """Return (2, K) azimuths and how far on the next ray is, in rows far thinner than the gap between beams."""
    micro_row = np.floor(elevation / _MICRO_ROW + shift).astype(np.int64)
    order = np.lexsort((azimuth, micro_row))
    same_row = np.diff(micro_row[order]) == 0
    return np.stack([azimuth[order][:-1][same_row], np.diff(azimuth[order])[same_row]])


def _row_density(
    azimuths: list[npt.NDArray], elevations: list[npt.NDArray], step: float | None, kept: float
) -> tuple[npt.NDArray, npt.NDArray]:
    """Return rows per elevation bin and the bins' edges; rays per radian of azimuth and bin where `step` is None."""
    low, high = min(e.min() for e in elevations), max(e.max() for e in elevations)
    n_bins = int((high - low) / _ELEVATION_BIN) + 1
    counts = np.zeros((len(azimuths), n_bins, _SECTORS))
    for i, (azimuth, elevation) in enumerate(zip(azimuths, elevations, strict=True)):
        u = ((azimuth + np.pi) / (2.0 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
        v = np.minimum(((elevation - low) / _ELEVATION_BIN).astype(np.int64), n_bins - 1)
        counts[i] = np.bincount(v * _SECTORS + u, minlength=n_bins * _SECTORS).reshape(n_bins, _SECTORS)
    per_bin = counts.transpose(1, 0, 2).reshape(n_bins, -1)  # (bins, frames x sectors)
    full = kept * 2.0 * np.pi / _SECTORS / (step or 1.0)  # rays of one row in a full sector
    # Sky and open roads return nothing: only sectors that return anything tell how dense the beams are.
    density = np.array([np.percentile(c[c > 0], 75) if (c > 0).any() else 0.0 for c in per_bin]) / full
    # Angles smeared by a motion that cannot be taken back fill the gaps between beams; a sector's total does not grow.
    most = np.percentile(per_bin.sum(axis=0), 95) / full
    density *= min(1.0, most / density.sum())
    _fill_silent_bins(density)
    return density, low + _ELEVATION_BIN * np.arange(n_bins + 1)


def _fill_silent_bins(density: npt.NDArray) -> None:
    """Give long runs of empty bins (beams into the sky) the mean density: rows must not close up where nothing was."""
    is_empty = np.concatenate([[False], density == 0.0, [False]])
    starts, ends = np.flatnonzero(np.diff(is_empty.astype(np.int8)).reshape(-1)).reshape(-1, 2).T
    for a, b in zip(starts, ends, strict=True):
        if (b - a) * _ELEVATION_BIN > _LONGEST_GAP:
            density[a:b] = density[density > 0.0].mean() * (density > 0.0).mean()


def _make_pattern(centres: npt.NDArray, step: float, sweep_time: npt.NDArray[np.float32]) -> BeamPattern:
    gaps = np.maximum(np.diff(centres), 1e-4)
    padded = np.concatenate([[centres[0] - gaps[0]], centres, [centres[-1] + gaps[-1]]])
    rows = np.arange(-1, len(centres) + 1) + 0.5
    elevation = np.arcsin(np.linspace(-1.0, 1.0, _SINE_BINS + 1))
    row_of_sine = np.interp(elevation, padded, rows, left=-2.0, right=len(centres) + 2.0).astype(np.float32)
    n_columns = 8 * max(round(2.0 * np.pi / step / 8), 1)
    return BeamPattern(
        len(centres), n_columns, float(np.median(gaps)), 2.0 * np.pi / n_columns, row_of_sine, sweep_time
    )


def _time_of_direction(azimuths: list[npt.NDArray], times: list[npt.NDArray | None]) -> npt.NDArray[np.float32]:
    out = np.zeros(_TIME_BINS, np.float32)
    known = [(a, t) for a, t in zip(azimuths, times, strict=True) if t is not None]
    if not known:
        return out
    azimuth, time = np.concatenate([a for a, _ in known]), np.concatenate([t for _, t in known]).astype(np.float64)
    bins = (_rough_turns(np.cos(azimuth), np.sin(azimuth)) * _TIME_BINS).astype(np.int64)
    n = np.maximum(np.bincount(bins, minlength=_TIME_BINS), 1)
    mean = np.bincount(bins, time, _TIME_BINS) / n
    spread = np.sqrt(np.maximum(np.bincount(bins, time**2, _TIME_BINS) / n - mean**2, 0.0))
    if np.median(spread[n > 1]) > 0.1:  # a tenth of the sweep: the pattern does not turn with time
        return out
    return mean.astype(np.float32)


@numba.njit(cache=True, nogil=True)
def _rough_turns(x, y):  # type: ignore[no-untyped-def]
    out = np.empty(len(x), np.float32)
    for i in range(len(x)):
        out[i] = rough_turn_of(np.float32(x[i]), np.float32(y[i]))
    return out


@numba.njit(cache=True, nogil=True)
def _transform_by_step(points, time, T, out):  # type: ignore[no-untyped-def]
    n = len(T)
    for i in range(len(points)):
        M = T[min(max(int((time[i] + 0.5) * n), 0), n - 1)]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(3):
            out[i, k] = M[k, 0] * x + M[k, 1] * y + M[k, 2] * z + M[k, 3]
