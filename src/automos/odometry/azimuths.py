"""How the azimuth runs along a file of points: the compiled loops behind `sweep_order`. Angles are in turns."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from automos.scan import Points

N_SECTORS = 720
"""Sectors in which a gap is looked for."""
BACKWARD = 0.03
"""Turns by which the azimuth steps back where one beam ends and the next begins."""


@numba.njit(cache=True, nogil=True)
def block_azimuths(points, block):  # type: ignore[no-untyped-def]
    """Return the mean azimuth in turns of every `block` points, NaN where none is valid, and how much they agree."""
    n_blocks = (len(points) + block - 1) // block
    azimuth, agreement = np.full(n_blocks, np.nan), np.zeros(n_blocks)
    for b in range(n_blocks):
        sx, sy, n = 0.0, 0.0, 0
        for i in range(b * block, min((b + 1) * block, len(points))):
            x, y = float(points[i, 0]), float(points[i, 1])
            r = np.sqrt(x * x + y * y)
            if 0.1 < r < 1e6:  # never true of NaN
                sx += x / r
                sy += y / r
                n += 1
        if n > 0:
            azimuth[b] = np.arctan2(sy, sx) / (2.0 * np.pi)
            agreement[b] = np.sqrt(sx * sx + sy * sy) / n
    return azimuth, agreement


@numba.njit(cache=True, nogil=True)
def seen_sectors(points):  # type: ignore[no-untyped-def]
    """Return (N_SECTORS,) bool: which sectors of azimuth, from -pi on, hold any point."""
    is_seen = np.zeros(N_SECTORS, np.bool_)
    for i in range(len(points)):
        x, y = float(points[i, 0]), float(points[i, 1])
        if 0.01 < x * x + y * y < 1e12:  # never true of NaN
            turn = np.arctan2(y, x) / (2.0 * np.pi) + 0.5
            is_seen[min(int(turn * N_SECTORS), N_SECTORS - 1)] = True
    return is_seen


@numba.njit(cache=True, nogil=True)
def unwrap(azimuth, turn):  # type: ignore[no-untyped-def]
    """Return how far each block lies behind the first, in turns: a gap is passed in the sensor's own direction."""
    out = np.full(len(azimuth), np.nan)
    last, total, is_first = 0.0, 0.0, True
    for b in range(len(azimuth)):
        if np.isnan(azimuth[b]):
            continue
        if is_first:
            is_first = False
        else:
            step = turn * (azimuth[b] - last)
            step -= np.floor(
                step + 0.1
            )  # a tenth of a turn back is noise of what is near the axis, more is a gap ahead
            total += step
        last = azimuth[b]
        out[b] = total
    return out


def between_blocks(turned: npt.NDArray[np.float64], block: int, n: int) -> npt.NDArray[np.float32]:
    """Return (n,) float32 the turns at every point, linear between the middles of blocks, 0 at the first point."""
    known = np.flatnonzero(~np.isnan(turned))
    out = np.zeros(n, np.float32)
    if len(known) > 1:
        _interpolate(known, turned, block, n, out)
    return out


@numba.njit(cache=True, nogil=True)
def _interpolate(known, turned, block, n, out):  # type: ignore[no-untyped-def]
    k = 0
    start = 0.0
    for i in range(n):
        place = (i - 0.5 * (block - 1)) / block
        while k < len(known) - 2 and place > known[k + 1]:
            k += 1
        a, b = known[k], known[k + 1]
        value = turned[a] + (turned[b] - turned[a]) * (place - a) / (b - a)
        if i == 0:
            start = value
        out[i] = max(value - start, 0.0)


def follow_gaps(
    points: Points, azimuth: npt.NDArray[np.float64], turn: int, block: int, turned: npt.NDArray[np.float32]
) -> None:
    """Correct `turned` where a block reaches across a sector without points: there a point's own azimuth tells more."""
    known = np.flatnonzero(~np.isnan(azimuth))
    if len(known) < 3:
        return
    steps = turn * np.diff(azimuth[known])
    steps -= np.floor(steps + 0.1)
    is_torn = np.zeros(len(azimuth), np.bool_)
    for k in np.flatnonzero(steps > 2.0 * np.median(steps)).tolist():
        is_torn[known[k] : known[k + 1] + 1] = True
    middle = min(known[0] * block + block // 2, len(turned) - 1)
    _follow(points, is_torn, turn, float(azimuth[known[0]] - turn * turned[middle]), block, turned)


@numba.njit(cache=True, nogil=True)
def _follow(points, is_torn, turn, start, block, turned):  # type: ignore[no-untyped-def]
    """Correct `turned` in torn blocks; `start` is the azimuth of the first point."""
    for i in range(len(points)):
        x, y = float(points[i, 0]), float(points[i, 1])
        if is_torn[i // block] and 0.01 < x * x + y * y < 1e12:  # never true of NaN
            off = turn * (np.arctan2(y, x) / (2.0 * np.pi) - start) - turned[i]
            turned[i] = max(turned[i] + off - np.rint(off), 0.0)


@numba.njit(cache=True, nogil=True)
def turns_by_beam(points, turn, start):  # type: ignore[no-untyped-def]
    """Return (N,) float32 the turns since azimuth `start` of a file sorted by beam; each beam begins anew."""
    out = np.zeros(len(points), np.float32)
    total, last, is_new = 0.0, 0.0, True
    for i in range(len(points)):
        x, y = float(points[i, 0]), float(points[i, 1])
        r = np.sqrt(x * x + y * y)
        if 0.1 < r < 1e6:
            azimuth = np.arctan2(y, x) / (2.0 * np.pi)
            step = turn * (azimuth - last)
            step -= np.rint(step)
            if is_new or step < -BACKWARD:
                total = turn * (azimuth - start)
                total -= np.floor(total + 0.1)
                is_new = False
            else:
                total += step
            last = azimuth
        out[i] = max(total, 0.0)
    return out
