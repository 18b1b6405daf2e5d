"""Whole numbers of cells from coordinates, in compiled kernels."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def whole_below(x):  # type: ignore[no-untyped-def]
    """Return the whole number below `x` as int64, 0 for what none of them can hold."""
    return np.int64(np.floor(x)) if abs(x) < 1e15 else np.int64(0)


@numba.njit(cache=True, nogil=True)
def sine_bin(z, r, n_bins):  # type: ignore[no-untyped-def]
    """Return where in `BeamPattern.row_of_sine` of `n_bins` a direction of height `z` at range `r` is found."""
    half = np.float32((n_bins - 1) / 2)
    at = (z / max(r, np.float32(1e-6)) + np.float32(1.0)) * half
    return int(at) if np.float32(0.0) <= at < n_bins else 0  # 0, straight down, for what is no number
