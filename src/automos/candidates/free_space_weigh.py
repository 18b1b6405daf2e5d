"""From what many scans say about a point to how surely it has moved.

A thing that moved came to its place at some time and left it at some time; in between it was hit, before and after its
place was observed free. The best such interval is found for every point and weighed against "it was always there":
what foliage, edges and grazing surfaces let through now and then never adds up, while a car that waited does.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_vote import HIT, THROUGH, WEAK
from automos.kernels import kernel

Votes = npt.NDArray[np.int8]

ONE = 64
"""A whole vote: votes are kept as int8 in fractions of it, because there are many."""


@kernel
def weigh_looks(codes, ranges, misses, own_ranges, heights, trusts, row_height, near_miss, weak_weight):  # type: ignore[no-untyped-def]
    """Return one scan's say on each point as a vote: -ONE for a hit, up to ONE for observed free, 0 for nothing.

    A free-space observation weighs less where the other scan looked from more than twice as far (its rays are sparser
    than the point's own), where no row of its rays came near the point (a parked car fits between two rows of a sparse
    sensor), and where the point is lower above the ground than two rows (a ray that grazed the ground). A weak one
    counts only from about as far at least as the point was seen.

    Parameters
    ----------
    codes, ranges, misses : (K,) what the scan says (`look_through`), from how far and how near a row came, metres.
    own_ranges, heights : (K,) metres, from the points' own sensor position and above the ground.
    trusts : (K,) in [0, 1], by which free-space observations of each point are multiplied.
    row_height : radians between the sensor's rows.
    near_miss : metres, how near a row of rays must come for a full vote.
    weak_weight : of a weak observation.
    """
    votes = np.zeros(len(codes), np.int8)
    for i in range(len(codes)):
        if codes[i] == HIT:
            votes[i] = -ONE
        elif codes[i] == THROUGH or codes[i] == WEAK:
            ratio = ranges[i] / max(own_ranges[i], 1.0)
            vote = min(1.0, 2.0 / max(ratio, 1e-3)) * min(1.0, near_miss / max(misses[i], 1e-3))
            if heights[i] > -0.3:  # further down than that the ground is a guess
                vote *= min(max(0.5 * heights[i] / max(row_height * ranges[i], 1e-3), 0.0), 1.0)
            if codes[i] == WEAK:
                vote *= weak_weight * min(max((ratio - 0.4) / 0.4, 0.0), 1.0)
            votes[i] = np.int8(ONE * trusts[i] * vote + 0.5)
    return votes


def sum_votes(votes: Votes, n_before: int, stay_weight: float) -> npt.NDArray[np.float32]:
    """Return (K,) how surely each point came and went: votes for that, minus `stay_weight` for every hit.

    votes : (P, K) of `weigh_looks`, scans in time order.   n_before : how many are from before the points' own scan.
    """
    came_and_left = _best_sum(votes[:n_before]) + _best_sum(votes[n_before:][::-1])
    return (came_and_left / ONE - stay_weight * count_hits(votes)).astype(np.float32)


def count_hits(votes: Votes) -> npt.NDArray[np.uint8]:
    """Return (K,) how many of `votes` (P, K) on each point are hits."""
    return (votes < 0).sum(axis=0, dtype=np.uint8)


def _best_sum(votes: Votes) -> npt.NDArray[np.int16]:
    """Return (K,) the greatest sum of the first so many of `votes` (P, K) on each point, 0 at least."""
    total, best = np.zeros((2, votes.shape[1]), np.int16)
    for of_scan in votes:
        total += of_scan
        np.maximum(best, total, out=best)
    return best
