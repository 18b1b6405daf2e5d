"""When a scan looked along each direction, and which of its points it saw when it last did.

Where every scan begins at the same azimuth, a direction is looked at at the same time in all. A driver that cuts
its stream by time begins each scan elsewhere, and one of more than a turn looks twice into a sector.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.kernels import kernel
from automos.scan import Points

N_DIRECTIONS = 360
MIN_POINTS = 100
"""Points of a scan, below which nothing is learnt from it."""
_SAME_LOOK = 0.5
"""Of a sweep: a direction that was looked at longer ago than this was looked at twice."""


@kernel
def rough_turn_of(x, y):  # type: ignore[no-untyped-def]
    """Return a number in [0, 1) that grows with the azimuth of (x, y) from -pi on; cheaper than `turn_of`."""
    share = np.float32(0.25) * (np.float32(1.0) - x / max(abs(x) + abs(y), np.float32(1e-9)))  # 0 ahead, 0.5 behind
    turn = np.float32(0.5) + share if y >= np.float32(0.0) else np.float32(0.5) - share
    return min(turn, np.float32(0.9999999)) if turn > np.float32(0.0) else np.float32(0.0)


def times_of_directions(raw: Points, times: npt.NDArray[np.float32] | None) -> npt.NDArray[np.float32]:
    """Return (360,) float32 when in the sweep a scan last looked along each direction; zeros where that is not fixed.

    raw : (M, 3) float32, sensor frame of the raw sweep.  times : (M,) in [-0.5, 0.5], or None.
    """
    if times is None or len(raw) < MIN_POINTS:
        return np.zeros(N_DIRECTIONS, np.float32)
    out, spread, n = _latest_times(raw, times, N_DIRECTIONS)
    seen = np.flatnonzero(n)
    if np.median(spread[n > 1]) > 0.1 if (n > 1).any() else True:  # of the sweep: the pattern does not turn with time
        return np.zeros(N_DIRECTIONS, np.float32)
    nearest = seen[np.searchsorted(0.5 * (seen[1:] + seen[:-1]), np.arange(N_DIRECTIONS))]
    return out[nearest]


@kernel
def _latest_times(raw, times, n_bins):  # type: ignore[no-untyped-def]
    """Return for each direction the mean time of the last look at it, its deviation, and how many points it saw."""
    latest = np.full(n_bins, np.float32(-1.0))
    total, square, n = np.zeros(n_bins), np.zeros(n_bins), np.zeros(n_bins, np.int64)
    for i in range(len(raw)):
        b = int(rough_turn_of(raw[i, 0], raw[i, 1]) * np.float32(n_bins))
        latest[b] = max(latest[b], times[i])
    for i in range(len(raw)):
        b = int(rough_turn_of(raw[i, 0], raw[i, 1]) * np.float32(n_bins))
        if times[i] > latest[b] - np.float32(_SAME_LOOK):
            total[b] += times[i]
            square[b] += float(times[i]) ** 2
            n[b] += 1
    mean, spread = np.zeros(n_bins, np.float32), np.zeros(n_bins)
    for b in range(n_bins):
        if n[b] > 0:
            mean[b] = total[b] / n[b]
            spread[b] = np.sqrt(max(square[b] / n[b] - float(mean[b]) ** 2, 0.0))
    return mean, spread, n


@kernel
def is_last_look(raw, times, latest):  # type: ignore[no-untyped-def]
    """Return (M,) bool: which points the scan saw when it last looked along their direction."""
    out = np.empty(len(raw), np.bool_)
    for i in range(len(raw)):
        b = int(rough_turn_of(raw[i, 0], raw[i, 1]) * np.float32(len(latest)))
        out[i] = times[i] > latest[b] - np.float32(_SAME_LOOK)
    return out
