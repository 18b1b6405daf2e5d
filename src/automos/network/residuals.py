"""Residual images: how much nearer or further the world was along each pixel a moment ago (LMNet, III-A).

An earlier scan is carried into the present one by the sensor's own motion and projected; what stands still then lies
at the same range, what moves does not. The pictures are made when they are needed, never stored.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
import numpy.typing as npt

from automos.network.projection import Image, ImageGrid, column_of, row_of
from automos.scan import Points, Pose

SPACING = 0.1
"""Seconds between the scans of successive residual images: one each at the 10 Hz of LMNet's recordings."""

MIN_RANGE, MAX_RANGE = 2.0, 50.0
"""Metres between which ranges have residuals (LMNet's configuration): the vehicle itself, and what is too sparse."""


def residual_images(
    range_now: Image,
    past: Sequence[Points | None],
    T_now_past: Pose,
    grid: ImageGrid,
) -> Image:
    """Return (K, H, W) float32: |range now - range before| / range now, 0 where either is missing.

    Parameters
    ----------
    range_now : (H, W) float32, metres, 0 where a pixel is empty.
    past : K earlier clouds (M, 3) float32 in their own sensor frames; None where there is none, which gives zeros.
    T_now_past : (K, 4, 4) from each cloud's frame to the present one.
    """
    out = np.zeros((len(past), grid.height, grid.width), np.float32)
    before = np.empty(grid.size, np.float32)
    for k, points in enumerate(past):
        if points is not None:
            T = np.asarray(T_now_past[k], np.float32)
            _reproject(np.ascontiguousarray(points), T, grid.row_of_sine, grid.height, grid.width, MAX_RANGE, before)
            _residual(range_now.reshape(-1), before, MIN_RANGE, MAX_RANGE, out[k].reshape(-1))
    return out


def pick_past(ages: npt.NDArray[np.float64], n: int, spacing: float = SPACING) -> npt.NDArray[np.int64]:
    """Return for residual images 1..n which earlier scan to take, -1 for none.

    Parameters
    ----------
    ages : (M,) seconds > 0 since each of the earlier scans.
    n : residual images; image k looks back k * spacing seconds.
    spacing : seconds. Scans that are further than this from the wanted moment are not taken, so sensors of any rate
        see the same spans of time.
    """
    wanted = spacing * np.arange(1, n + 1)
    if len(ages) == 0:
        return np.full(n, -1)
    off = np.abs(ages[None, :] - wanted[:, None])  # (n, M)
    best = off.argmin(axis=1)
    return np.where(off[np.arange(n), best] <= 1.001 * spacing, best, -1)


@numba.njit(cache=True, nogil=True)
def _reproject(points, T, row_of_sine, height, width, farthest, before):  # type: ignore[no-untyped-def]
    before[:] = np.inf
    for i in range(len(points)):
        a, b, c = points[i, 0], points[i, 1], points[i, 2]
        x = T[0, 0] * a + T[0, 1] * b + T[0, 2] * c + T[0, 3]
        y = T[1, 0] * a + T[1, 1] * b + T[1, 2] * c + T[1, 3]
        z = T[2, 0] * a + T[2, 1] * b + T[2, 2] * c + T[2, 3]
        r = np.sqrt(x * x + y * y + z * z)
        if np.float32(1e-3) < r < farthest:  # never true of NaN
            row = row_of(z / r, row_of_sine)
            if 0 <= row < height:  # what lies beyond the beams of now was not measured now
                p = row * width + column_of(x, y, width)
                before[p] = min(before[p], r)


@numba.njit(cache=True, nogil=True)
def _residual(now, before, nearest, farthest, out):  # type: ignore[no-untyped-def]
    for p in range(len(now)):
        if nearest < now[p] < farthest and nearest < before[p] < farthest:
            out[p] = abs(now[p] - before[p]) / now[p]
