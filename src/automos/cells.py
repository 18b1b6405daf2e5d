"""Whole numbers of cells from coordinates, in compiled kernels."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def whole_below(x):  # type: ignore[no-untyped-def]
    """Return the whole number below `x` as int64, 0 for what none of them can hold."""
    return np.int64(np.floor(x)) if abs(x) < 1e15 else np.int64(0)
