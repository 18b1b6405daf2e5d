"""The grid of one sensor's rays: rows by elevation, columns by azimuth, about one ray in each cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

N_DIRECTIONS = 360
"""Number of azimuth directions for which the time in the sweep is known."""
_SINE_BINS = 4096
_N_LEVELS = 5


class Pyramid(NamedTuple):
    """Memory layout of the levels of the grid, from fine to coarse.

    Attributes
    ----------
    shifts : (L, 2) int64, binary logarithms of the numbers of rows and columns in a cell.
    shapes : (L, 2) int64, rows and columns of each level.
    offsets : (L + 1,) int64, start of each level.
    widths : (L,) float32, longer side of a cell, radians.
    """

    shifts: npt.NDArray[np.int64]
    shapes: npt.NDArray[np.int64]
    offsets: npt.NDArray[np.int64]
    widths: npt.NDArray[np.float32]


class BeamPattern(NamedTuple):
    """The grid of rays of one sensor.

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


def make_pattern(
    centres: npt.NDArray[np.float64], step: float, sweep_time: npt.NDArray[np.float32] | None = None
) -> BeamPattern:
    """Return the grid of rows at elevations `centres` (H,), radians, and columns `step` radians apart."""
    gaps = np.maximum(np.diff(centres), 1e-4)
    padded = np.concatenate([[centres[0] - gaps[0]], centres, [centres[-1] + gaps[-1]]])
    rows = np.arange(-1, len(centres) + 1) + 0.5
    elevation = np.arcsin(np.linspace(-1.0, 1.0, _SINE_BINS + 1))
    row_of_sine = np.interp(elevation, padded, rows, left=-2.0, right=len(centres) + 2.0).astype(np.float32)
    n_columns = 8 * max(round(2.0 * np.pi / step / 8), 1)
    cell = float(np.median(gaps)), 2.0 * np.pi / n_columns
    times = np.zeros(N_DIRECTIONS, np.float32) if sweep_time is None else sweep_time
    return BeamPattern(len(centres), n_columns, *cell, row_of_sine, times, _pyramid((len(centres), n_columns), cell))


def _pyramid(shape: tuple[int, int], cell: tuple[float, float]) -> Pyramid:
    """Return the levels of a grid; columns are merged first, until cells are about square."""
    lead = max(round(float(np.log2(cell[0] / cell[1]))), 0)
    shifts = np.array([[max(level - lead, 0), level] for level in range(_N_LEVELS)])
    shapes = -(-np.array([shape]) // (1 << shifts))
    offsets = np.concatenate([[0], np.cumsum(shapes.prod(axis=1))])
    return Pyramid(shifts, shapes, offsets, ((1 << shifts) * cell).max(axis=1).astype(np.float32))


def directions(pattern: BeamPattern, rows: npt.NDArray, columns: npt.NDArray) -> npt.NDArray[np.float64]:
    """Return the (M, 3) unit vectors through the centres of cells (`rows`, `columns`), sensor frame."""
    known = (pattern.row_of_sine > -1.0) & (pattern.row_of_sine < pattern.n_rows + 1.0)
    sines = np.linspace(-1.0, 1.0, len(known))[known]
    sine = np.interp(rows + 0.5, pattern.row_of_sine[known], sines)
    azimuth = 2.0 * np.pi * (columns + 0.5) / pattern.n_columns - np.pi
    cosine = np.sqrt(1.0 - sine**2)
    return np.column_stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine])
