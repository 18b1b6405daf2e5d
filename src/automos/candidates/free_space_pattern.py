"""Where a sensor's beams point, learnt from its own scans.

Every sensor leaves its pattern in the angles of its returns: how far apart neighbouring firings of one beam are, and
how many beams there are per degree at each elevation. With both, (elevation, azimuth) maps to a grid of rows and
columns in which about one ray falls into each cell, whether the beams are evenly spaced, in blocks, few, or never
repeat. Angles are those of the raw sweep, before the sensor's motion is taken out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_looks import MIN_POINTS, N_DIRECTIONS, is_last_look, times_of_directions
from automos.geometry import se3_exp
from automos.kernels import kernel
from automos.scan import Frame, Points

_SINE_BINS = 4096
_MICRO_ROW, _ROUGH_ROW = np.radians(0.05), np.radians(0.1)
"""Height of rows far thinner than the gap between beams; where coordinates were rounded, twice that."""
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
        `rough_turn_of`; zeros where directions have no fixed time. A driver that cuts its stream by time has another
        one in every scan: `seen_in` returns it.
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


def learn_pattern(frames: Iterable[Frame]) -> BeamPattern:
    """Return the beam pattern that the raw angles of `frames` show (a handful of frames is enough).

    Frames of hardly a point show none; where all are like that, rows and columns are half a degree apart.
    """
    azimuths, elevations, is_far, frame_times = [], [], [], np.zeros(N_DIRECTIONS, np.float32)
    for frame in frames:
        if len(frame.points) < MIN_POINTS:
            continue
        raw = raw_points(frame)
        points = raw.astype(np.float64)
        azimuths.append(np.arctan2(points[:, 1], points[:, 0]))
        elevations.append(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
        ranges = np.linalg.norm(points, axis=1)
        is_far.append(ranges > np.median(ranges))
        frame_times = frame_times if frame_times.any() else times_of_directions(raw, frame.sweep_time)
    if not azimuths:
        return _unknown_pattern()
    step, kept = _azimuth_step(azimuths, elevations, _MICRO_ROW)
    if step is None:  # where coordinates were rounded, angles are exact only far away
        far = [
            [angles[k] for angles, k in zip(all_angles, is_far, strict=True)] for all_angles in (azimuths, elevations)
        ]
        step, kept = _azimuth_step(far[0], far[1], _ROUGH_ROW)
    density, edges = _row_density(
        azimuths, elevations, step, kept
    )  # rows per bin, for one ray per row and azimuth step
    if not (np.isfinite(density).all() and density.sum() > 0.0):  # all points on a line or at one place
        return _unknown_pattern()
    if step is None:  # no beam repeats: square cells, one ray in each
        step = float(np.sqrt(_ELEVATION_BIN * len(density) / density.sum()))
        density = density * step
    rows = np.concatenate([[0.0], np.cumsum(density)])
    n_rows = max(round(rows[-1]), 2)
    centres = np.interp((np.arange(n_rows) + 0.5) * rows[-1] / n_rows, rows, edges)
    return _make_pattern(centres, step, frame_times)


def seen_in(frame: Frame, raw: Points, pattern: BeamPattern) -> tuple[BeamPattern, npt.NDArray[np.bool_]]:
    """Return the pattern with the times of one scan, and which of its points the sensor saw when it last looked there.

    A scan of more than a turn looks twice into a sector, from two places. One range image can show only one of them.

    Parameters
    ----------
    frame : the scan.
    raw : (M, 3) its `raw_points`.
    pattern : of the sensor.

    Returns
    -------
    pattern : the same with the `sweep_time` of this scan.
    is_last : (M,) bool, all true where no sector was seen twice.
    """
    times = times_of_directions(raw, frame.sweep_time)
    if frame.sweep_time is None or not times.any():
        return pattern._replace(sweep_time=times), np.ones(len(raw), np.bool_)
    return pattern._replace(sweep_time=times), is_last_look(raw, frame.sweep_time, times)


def _unknown_pattern() -> BeamPattern:
    half_degree = np.radians(0.5)
    return _make_pattern(np.arange(-60, 60) * half_degree, half_degree, np.zeros(N_DIRECTIONS, np.float32))


def _azimuth_step(azimuths: list[npt.NDArray], elevations: list[npt.NDArray], row: float) -> tuple[float | None, float]:
    """Return the radians between firings of one beam and the share of rays that were kept in a thinned-out scan.

    None and 1 where neighbours in a row keep no common distance.
    """
    edges = np.geomspace(np.radians(0.02), np.radians(3.0), 101)  # 5 % wide
    best_share, step, kept = 0.0, None, 1.0
    for shift in (0.0, 0.5):  # a beam on the border of two rows would be torn apart
        parts = [_neighbour_gaps(a, e, row, shift) for a, e in zip(azimuths, elevations, strict=True)]
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


def _neighbour_gaps(azimuth: npt.NDArray, elevation: npt.NDArray, row: float, shift: float) -> npt.NDArray:
    """Return (2, K) azimuths and how far on the next ray is, in rows of height `row`, radians."""
    micro_row = np.floor(elevation / row + shift).astype(np.int64)
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
    density = np.array([np.percentile(c[c > 0], 75) if (c > 0).any() else 0.0 for c in per_bin])
    with np.errstate(invalid="ignore", divide="ignore"):
        density /= full
    # Angles smeared by a motion that cannot be taken back fill the gaps between beams; a sector's total does not grow.
    most = np.percentile(per_bin.sum(axis=0), 95) / full
    with np.errstate(invalid="ignore", divide="ignore"):  # told from a pattern by who asks
        density *= min(1.0, most / density.sum())
    _fill_silent_bins(density)
    return density, low + _ELEVATION_BIN * np.arange(n_bins + 1)


def _fill_silent_bins(density: npt.NDArray) -> None:
    """Give long runs of empty bins (beams into the sky) the mean density: rows must not close up where nothing was."""
    if not (density > 0.0).any():
        return
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


@kernel
def _transform_by_step(points, time, T, out):  # type: ignore[no-untyped-def]
    n = len(T)
    for i in range(len(points)):
        step = (time[i] + 0.5) * n
        M = T[int(min(step, n - 1.0)) if step > 0.0 else 0]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(3):
            out[i, k] = M[k, 0] * x + M[k, 1] * y + M[k, 2] * z + M[k, 3]
