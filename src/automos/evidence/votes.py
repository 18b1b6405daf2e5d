"""The votes of other scans on the places of a scan's points, weighted reports of `look_through`, and their sum.

An object that moved came to its place and left it: its place was hit in between, and observed free before and after.
The best such interval is found for every point and weighed against "it was always there". Free-space observations of
foliage, edges and grazing surfaces do not add up, while those of a car that waited do.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.evidence.height_map import MAX_STEP
from automos.evidence.look_through import BENEATH, HIT, THROUGH, WEAK

Votes = npt.NDArray[np.int8]
ONE = 64  # a full vote; votes are stored as int8 in fractions of it to save memory


@kernel
def weigh_looks(codes, ranges, own_ranges, heights, trusts, row_height):  # type: ignore[no-untyped-def]
    """Return one scan's report on each point as a vote: -ONE for a hit, up to ONE for observed free, 0 for nothing.

    Ground beneath a place is a hit if the place is so low that it may be ground itself. A free-space observation counts
    less if the other sensor was more than twice as far away (its rays are sparser than the point's own), and if the
    point is lower above the ground than two rows (a ray may have grazed the ground). A weak observation counts only if
    the other sensor was about as far away as the point's own, or farther.

    Parameters
    ----------
    codes, ranges : (K,), the report as `look_through` returns it.
    own_ranges, heights : (K,) float32, metres, range from the points' own sensor and height above the ground.
    trusts : (K,) float64 in [0, 1], factor on the free-space observations of each point.
    row_height : float32, radians between rows.

    Equation: vote
    """
    votes = np.zeros(len(codes), np.int8)
    for i in range(len(codes)):
        if codes[i] == HIT or (codes[i] == BENEATH and heights[i] < MAX_STEP):
            votes[i] = -ONE
        elif codes[i] == THROUGH or codes[i] == WEAK:
            ratio = ranges[i] / max(own_ranges[i], 1.0)
            vote = min(1.0, 2.0 / max(ratio, 1.0))
            if heights[i] > -MAX_STEP:  # the ground is uncertain further below
                vote *= min(max(0.5 * heights[i] / (row_height * ranges[i]), 0.0), 1.0)
            if codes[i] == WEAK:
                vote *= min(max(2.0 * ratio - 1.0, 0.0), 1.0)
            votes[i] = np.int8(ONE * trusts[i] * vote + 0.5)
    return votes


def sum_votes(votes: Votes, n_before: int, stay_weight: float) -> npt.NDArray[np.float32]:
    """Return (K,) the evidence that each point came and left: the votes for that, minus `stay_weight` for every hit.

    `votes` (P, K) are those of `weigh_looks`, of scans in time order, `n_before` of them before the points' own.

    Equation: evidence
    """
    came_and_left = _best_sum(votes[:n_before]) + _best_sum(votes[n_before:][::-1])
    return (came_and_left / ONE - stay_weight * count_hits(votes)).astype(np.float32)


def count_hits(votes: Votes) -> npt.NDArray[np.uint8]:
    """Return (K,) the number of hits among the `votes` (P, K) on each point."""
    return (votes < 0).sum(axis=0, dtype=np.uint8)


def _best_sum(votes: Votes) -> npt.NDArray[np.int16]:
    """Return (K,) the greatest partial sum of `votes` (P, K) on each point, taken in order; at least 0."""
    total, best = np.zeros((2, votes.shape[1]), np.int16)
    for of_scan in votes:
        total += of_scan
        np.maximum(best, total, out=best)
    return best
