"""How much an observation is worth: scans within a look see the same, and count by the time between them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Array = npt.NDArray[np.float64]
LOOK = 1.7  # seconds within which scans say the same
MEMORY = 8.0
"""Seconds of a track that count scan by scan; a stream keeps as many of it, or its lag if that is longer."""


def looks(first: npt.NDArray[np.int64], times: Array, look: float = LOOK, since: Array | float = -np.inf) -> Array:
    """Return (R,) the looks that each observation is worth: 1, or the time since the one before if that is less.

    first : (T + 1,) the first observation of each track.   times : (R,) seconds.
    since : (T,) seconds of an observation before the first one.
    """
    before = np.append(times[:1], times[:-1])
    is_seen = np.diff(first) > 0
    before[first[:-1][is_seen]] = np.broadcast_to(since, len(is_seen))[is_seen]
    return np.minimum((times - before) / look, 1.0)


@kernel
def share_first_looks(worth, first, times, is_new):  # type: ignore[no-untyped-def]
    """Share the looks within the first one of new tracks (T,) evenly among its observations, in place.

    Of a look no scan says more than another, and of what comes into sight the first scan knows least.
    """
    for k in np.flatnonzero(is_new):
        begin = stop = first[k]
        while stop < first[k + 1] and times[stop] < times[begin] + LOOK:
            stop += 1
        if stop > begin:
            worth[begin:stop] = worth[begin:stop].sum() / (stop - begin)
