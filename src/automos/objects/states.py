"""The states of bodies in time: each stands or moves in every scan, a Markov chain in continuous time.

    p(s_1..T, y_1..T) = p(s_1) p(y_1 | s_1) prod_t p(s_t | s_t-1; dt_t) p(y_t | s_t),    s_t in {stands, moves}

The chain does not know where likelihoods come from. Filter, fixed lag and smoother are one model, conditioned on the
scans that are given. "Moves now" and "moved at some time" are two readings of its states: p(s_t = moves | y), and one
minus the probability of the path that stands in every scan.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Array = npt.NDArray[np.float64]


def state_probabilities(
    first: npt.NDArray[np.int64], times: Array, ratio: Array, start: float, begin: float, end: float
) -> tuple[Array, Array]:
    """Return p_moving (R,) and p_ever (T,) of T bodies, given all of their scans.

    Parameters
    ----------
    first : (T + 1,) the first row of each body.
    times : (R,) seconds, increasing within a body.
    ratio : (R,) log p(y_t | moves) - log p(y_t | stands).
    start : probability that a body moves in its first scan.
    begin, end : per second, rates at which a standing body sets off, and a moving one comes to rest.

    Returns
    -------
    p_moving : probability that the body moves in that scan.
    p_ever : that it has moved in any scan; 0 of a body without rows.

    Equations: states, readings
    """
    p_moving, p_ever = np.zeros(len(times)), np.zeros(len(first) - 1)
    for k, (low, high) in enumerate(pairwise(first)):
        if high > low:
            p_moving[low:high], p_ever[k] = _smoothed(times[low:high], ratio[low:high], start, begin, end)
    return p_moving, p_ever


@kernel
def _predict(p, dt, begin, end):  # type: ignore[no-untyped-def]
    """Return the probability of moving `dt` seconds later."""
    rest = begin / (begin + end)
    return rest + (p - rest) * np.exp(-(begin + end) * dt)


@kernel
def _condition(p, ratio):  # type: ignore[no-untyped-def]
    """Return the probability of moving, given a scan with the log-likelihood `ratio`, and the log of its likelihood."""
    moves, stands = np.log(p) + ratio, np.log1p(-p)
    total = np.logaddexp(moves, stands)
    # Never exactly certain: a chain that is could not change its state.
    return min(max(np.exp(moves - total), 1e-300), 1.0 - 1e-16), total


@kernel
def _smoothed(times, ratio, start, begin, end):  # type: ignore[no-untyped-def]
    n = len(times)
    ahead, now = np.empty(n), np.empty(n)
    p, log_total, log_stands = start, 0.0, np.log1p(-start)
    for t in range(n):
        if t > 0:
            p = _predict(now[t - 1], times[t] - times[t - 1], begin, end)
            log_stands += np.log1p(-_predict(0.0, times[t] - times[t - 1], begin, end))
        ahead[t] = p
        now[t], likelihood = _condition(p, ratio[t])
        log_total += likelihood
    p_moving = now.copy()
    for t in range(n - 2, -1, -1):
        dt = times[t + 1] - times[t]
        to_moves, to_stands = _predict(1.0, dt, begin, end), 1.0 - _predict(1.0, dt, begin, end)
        p = p_moving[t + 1]
        p = now[t] * (to_moves * p / ahead[t + 1] + to_stands * (1.0 - p) / (1.0 - ahead[t + 1]))
        p_moving[t] = min(max(p, 0.0), 1.0)
    return p_moving, -np.expm1(min(log_stands - log_total, 0.0))
