"""The states of bodies in time: each stands or moves in every scan, a Markov chain in continuous time.

    p(s_1..T, y_1..T) = p(s_1) p(y_1 | s_1) prod_t p(s_t | s_t-1; dt_t) p(y_t | s_t),    s_t in {stands, moves}

The chain does not know where likelihoods come from. Filter (lag 0), fixed lag and smoother (lag infinity) are one
model, conditioned in three ways. "Moves now" and "moved at some time" are two readings of its states: p(s_t = moves |
y), and one minus the probability of the path that stands in every scan.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Array = npt.NDArray[np.float64]


def state_probabilities(
    log_likelihoods: Array, times: Array, start: float, begin: float, end: float, lag: float = math.inf
) -> tuple[Array, Array]:
    """Return p_moving (T,) and p_ever (T,), given the scans that are no later than `lag` after each.

    Parameters
    ----------
    log_likelihoods : (T, 2), log p(y_t | stands) and log p(y_t | moves), each up to a constant of the scan.
    times : (T,) seconds, increasing.
    start : probability that the body moves in the first scan.
    begin, end : per second, rates at which a standing body sets off, and a moving one comes to rest.
    lag : seconds; 0 filters, infinity smooths.

    Returns
    -------
    p_moving : probability that the body moves in that scan.
    p_ever : that it has moved in any scan up to the last one that is known by then.

    Equations: states, readings
    """
    ratio = np.ascontiguousarray(log_likelihoods[:, 1] - log_likelihoods[:, 0])
    until = np.searchsorted(times, times + lag, side="right") - 1
    return _conditioned(np.asarray(times, np.float64), ratio, start, begin, end, until)


def chain_of_two(
    first: npt.NDArray[np.int64], times: Array, ratio: Array, start: float, begin: float, end: float
) -> tuple[Array, Array]:
    """Return p_moving (R,) and p_ever (T,) of T bodies, given all of their scans.

    first : (T + 1,) the first row of each body.   ratio : (R,) log-likelihood ratio of moving against standing.

    Equations: states, readings
    """
    p_moving, p_ever = np.zeros(len(times)), np.zeros(len(first) - 1)
    for k in range(len(first) - 1):
        rows = slice(first[k], first[k + 1])
        if first[k + 1] > first[k]:
            until = np.full(first[k + 1] - first[k], first[k + 1] - first[k] - 1)
            p_moving[rows], ever = _conditioned(times[rows], ratio[rows], start, begin, end, until)
            p_ever[k] = ever[-1]
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
def _conditioned(times, ratio, start, begin, end, until):  # type: ignore[no-untyped-def]
    n = len(times)
    ahead, now, likelihood, stands = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    p, log_total, log_stands = start, 0.0, np.log1p(-start)
    for t in range(n):
        if t > 0:
            p = _predict(now[t - 1], times[t] - times[t - 1], begin, end)
            log_stands += np.log1p(-_predict(0.0, times[t] - times[t - 1], begin, end))
        ahead[t] = p
        now[t], likelihood[t] = _condition(p, ratio[t])
        log_total += likelihood[t]
        stands[t] = log_stands - log_total
    p_moving, p_ever = np.empty(n), np.empty(n)
    for t in range(n - 1, -1, -1):
        p_ever[t] = -np.expm1(min(stands[until[t]], 0.0))
        # The belief at the next scan serves if it is conditioned on the same scans.
        is_next = t + 1 < n and until[t] == until[t + 1]
        p = p_moving[t + 1] if is_next else now[until[t]]
        for k in range(t if is_next else until[t] - 1, t - 1, -1):
            dt = times[k + 1] - times[k]
            to_moves, to_stands = _predict(1.0, dt, begin, end), 1.0 - _predict(1.0, dt, begin, end)
            p = now[k] * (to_moves * p / ahead[k + 1] + to_stands * (1.0 - p) / (1.0 - ahead[k + 1]))
        p_moving[t] = min(max(p, 0.0), 1.0)
    return p_moving, p_ever
