"""From what many scans say about a point to how surely it has moved.

A thing that moved came to its place at some time and left it at some time; in between it was hit, before and after it
was seen through. The best such interval is found for every point and weighed against "it was always there": what
foliage, edges and grazing surfaces let through now and then never adds up, while a car that waited does.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_vote import HIT, THROUGH, WEAK
from automos.kernels import kernel
from automos.scan import Mask

Votes = npt.NDArray[np.int8]

ONE = 64
"""A whole vote: votes are kept as int8 in fractions of it, because there are many."""


@kernel
def weigh_looks(codes, ranges, misses, own_ranges, heights, row_height, near_miss, weak_weight, ids, votes):  # type: ignore[no-untyped-def]
    """Write one scan's say on each point as a vote: -ONE for a hit, up to ONE for a see-through, 0 for nothing.

    A see-through weighs less where the other scan looked from more than twice as far (its rays are sparser than the
    point's own), where no row of its rays came near the point (a parked car fits between two rows of a sparse sensor),
    and where the point is lower above the ground than two rows (a ray that grazed the ground). A weak one counts only
    from about as far at least as the point was seen.

    Parameters
    ----------
    codes, ranges, misses : (J,) what the scan says (`look_through`), from how far and how near a row came, metres.
    own_ranges, heights : (K,) metres, of all points, from their own sensor position and above the ground.
    row_height : radians between the sensor's rows.
    near_miss : metres, how near a row of rays must come for a full vote.
    weak_weight : of a weak see-through.
    ids : (J,) which points were asked about.
    votes : (K,) int8, written at `ids`.
    """
    for j in range(len(ids)):
        i = ids[j]
        if codes[j] == HIT:
            votes[i] = -ONE
        elif codes[j] == THROUGH or codes[j] == WEAK:
            ratio = ranges[j] / max(own_ranges[i], 1.0)
            vote = min(1.0, 2.0 / max(ratio, 1e-3)) * min(1.0, near_miss / max(misses[j], 1e-3))
            if heights[i] > -0.3:  # further down than that the ground is a guess
                vote *= min(max(0.5 * heights[i] / max(row_height * ranges[j], 1e-3), 0.0), 1.0)
            if codes[j] == WEAK:
                vote *= weak_weight * min(max((ratio - 0.4) / 0.4, 0.0), 1.0)
            votes[i] = np.int8(ONE * vote + 0.5)


def join_votes(votes: npt.NDArray[np.int8], more: npt.NDArray[np.int8]) -> None:
    """Join to `votes` (K,) of a scan what another of its LiDARs says: any hit stands, else the surer see-through."""
    np.copyto(votes, np.where((votes < 0) | (more < 0), np.minimum(votes, more), np.maximum(votes, more)))


def find_open(votes: Votes, is_asked: Mask, sure_hits: int) -> npt.NDArray[np.int64]:
    """Return the ids (J,) of the points that those asked do not agree to have hit.

    votes : (P, K) int8.   is_asked : (P,) which rows hold votes.   sure_hits : how many hits are enough.
    """
    asked = votes[is_asked]
    n_hits = (asked < 0).sum(axis=0, dtype=np.uint8)
    return np.flatnonzero((asked.max(axis=0, initial=0) > 0) | (n_hits < sure_hits))


def find_seen_through(votes: Votes) -> npt.NDArray[np.int64]:
    """Return the ids (J,) of the points with any see-through in `votes` (P, K) int8."""
    return np.flatnonzero(votes.max(axis=0, initial=0) > 0)


@kernel
def weaken_lone(votes, ids, is_supported, weight):  # type: ignore[no-untyped-def]
    """Multiply the see-throughs of the points `ids` (J,) by `weight` where they are not supported (J,) bool."""
    for j in range(len(ids)):
        if not is_supported[j]:
            for k in range(len(votes)):
                if votes[k, ids[j]] > 0:
                    votes[k, ids[j]] = np.int8(weight * votes[k, ids[j]] + 0.5)


@kernel
def sum_votes(votes, n_before, stay_weight, net, through, hits):  # type: ignore[no-untyped-def]
    """Write how surely each point came and went.

    Parameters
    ----------
    votes : (P, K) int8 of `weigh_looks`, scans in time order.
    n_before : how many of them are from before the points' own scan.
    stay_weight : what a hit costs while the thing was there; 1 more when it was away.
    net, through, hits : (K,) float32, uint8, uint8, written: the sum, and how many scans saw through and hit.
    """
    n_scans, n = votes.shape
    running, best = np.zeros(n, np.int16), np.zeros(n, np.int16)
    through[:] = 0
    hits[:] = 0
    net[:] = 0.0
    for side in range(2):
        running[:] = 0
        best[:] = 0
        first, last, step = (0, n_before, 1) if side == 0 else (n_scans - 1, n_before - 1, -1)
        for k in range(first, last, step):
            for i in range(n):
                vote = votes[k, i]
                running[i] += vote
                best[i] = max(best[i], running[i])
                through[i] += vote > 0
                hits[i] += vote < 0
        for i in range(n):
            net[i] += best[i]
    for i in range(n):
        net[i] = net[i] / ONE - stay_weight * hits[i]
