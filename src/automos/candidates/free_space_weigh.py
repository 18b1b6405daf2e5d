"""From what many scans say about a point to how surely it has moved.

A thing that moved came to its place at some time and left it at some time; in between it was hit, before and after it
was seen through. The best such interval is found for every point and weighed against "it was always there": what
foliage, edges and grazing surfaces let through now and then never adds up, while a car that waited does.
"""

from __future__ import annotations

import numba

from automos.candidates.free_space_vote import HIT, THROUGH, WEAK


@numba.njit(cache=True, nogil=True)
def weigh_looks(codes, ranges, own_ranges, heights, row_height, weak_weight, ids, votes):  # type: ignore[no-untyped-def]
    """Write one scan's say on each point as a vote: -1 for a hit, up to 1 for a see-through, 0 for nothing.

    A see-through weighs less where the other scan looked from more than twice as far (its rays are sparser than the
    point's own), and where the point is lower above the ground than two of the other scan's rows (a ray that grazed the
    ground). A weak one counts only from about as far at least as the point was seen.

    Parameters
    ----------
    codes, ranges : (J,) what the scan says (`look_through`) and from how far, metres.
    own_ranges, heights : (K,) metres, of all points, from their own sensor position and above the ground.
    row_height : radians between the sensor's rows.
    weak_weight : of a weak see-through.
    ids : (J,) which points were asked about.
    votes : (K,) float32, written at `ids`.
    """
    for j in range(len(ids)):
        i = ids[j]
        if codes[j] == HIT:
            votes[i] = -1.0
        elif codes[j] == THROUGH or codes[j] == WEAK:
            ratio = ranges[j] / max(own_ranges[i], 1.0)
            vote = min(1.0, 2.0 / max(ratio, 1e-3))
            if heights[i] > -0.3:  # further down than that the ground is a guess
                vote *= min(max(0.5 * heights[i] / max(row_height * ranges[j], 1e-3), 0.0), 1.0)
            if codes[j] == WEAK:
                vote *= weak_weight * min(max((ratio - 0.4) / 0.4, 0.0), 1.0)
            votes[i] = vote


@numba.njit(cache=True, nogil=True)
def sum_votes(votes, n_before, stay_weight, net, through, hits):  # type: ignore[no-untyped-def]
    """Write how surely each point came and went.

    Parameters
    ----------
    votes : (P, K) float32 of `weigh_looks`, scans in time order.
    n_before : how many of them are from before the points' own scan.
    stay_weight : what a hit costs while the thing was there; 1 more when it was away.
    net, through, hits : (K,) float32, uint8, uint8, written: the sum, and how many scans saw through and hit.
    """
    n_scans, n = votes.shape
    for i in range(n):
        came, left, best_came, best_left = 0.0, 0.0, 0.0, 0.0
        n_through, n_hits = 0, 0
        for k in range(n_before):
            came += votes[k, i]
            best_came = max(best_came, came)
        for k in range(n_scans - 1, n_before - 1, -1):
            left += votes[k, i]
            best_left = max(best_left, left)
        for k in range(n_scans):
            n_through += votes[k, i] > 0.0
            n_hits += votes[k, i] < 0.0
        net[i] = best_came + best_left - stay_weight * n_hits
        through[i], hits[i] = n_through, n_hits
