"""The states of bodies in time: each stands or moves in every scan, a Markov chain in continuous time.

    p(s_1..T, y_1..T) = p(s_1) p(y_1 | s_1) prod_t p(s_t | s_t-1; dt_t) p(y_t | s_t),    s_t in {stands, moves}

The chain does not know where likelihoods come from. Filter (lag 0), fixed lag and smoother (lag infinity) are one
model: the scans that are known by then. What forgotten scans said is in two numbers, p(moves) and p(has moved) at the
last of them, so a stream keeps some seconds and loses nothing.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Array = npt.NDArray[np.float64]


def state_probabilities(
    first: npt.NDArray[np.int64], times: Array, ratio: Array, start: Array, ever: Array, begin: float, end: float
) -> tuple[Array, Array]:
    """Return p_moving (R,) and p_ever (T,) of T bodies, given all of their scans.

    Parameters
    ----------
    first : (T + 1,) the first row of each body.
    times : (R,) seconds, increasing within a body.
    ratio : (R,) log p(y_t | moves) - log p(y_t | stands).
    start, ever : (T,) probability that a body moves in its first scan, and that it has moved by then.
    begin, end : per second, rates at which a standing body sets off, and a moving one comes to rest.

    Returns
    -------
    p_moving : probability that the body moves in that scan.
    p_ever : that it has moved in any scan up to its last one, or before.

    Equations: states, readings
    """
    p_moving, p_ever = np.zeros(len(times)), np.array(ever, np.float64)
    _smooth_states(first, times, ratio, start, p_ever, begin, end, p_moving)
    return p_moving, p_ever


def later(p_moving: Array, p_ever: Array, dt: Array, begin: float, end: float) -> tuple[Array, Array]:
    """Return both probabilities `dt` seconds later, before anything is seen; after infinite time nothing is known."""
    rest, still = begin / (begin + end), np.exp(-(begin + end) * dt)
    return rest + (p_moving - rest) * still, 1.0 - (1.0 - p_ever) * (1.0 - rest + rest * still)


@kernel
def _predict(p, dt, begin, end):  # type: ignore[no-untyped-def]
    """Return the probability of moving `dt` seconds later."""
    rest = begin / (begin + end)
    return rest + (p - rest) * np.exp(-(begin + end) * dt)


@kernel
def _smoothed(times, ratio, p, ever, begin, end):  # type: ignore[no-untyped-def]
    n = len(times)
    ahead, now = np.empty(n), np.empty(n)
    log_total, log_stands = 0.0, np.log1p(-ever)
    for t in range(n):
        if t > 0:
            p = _predict(p, times[t] - times[t - 1], begin, end)
            log_stands += np.log1p(-_predict(0.0, times[t] - times[t - 1], begin, end))
        ahead[t] = p
        moves, stands = np.log(p) + ratio[t], np.log1p(-p)
        total = np.logaddexp(moves, stands)
        log_total += total
        # Never exactly certain: a chain that is could not change its state.
        p = now[t] = min(max(np.exp(moves - total), 1e-300), 1.0 - 1e-16)
    for t in range(n - 2, -1, -1):
        to_moves = _predict(1.0, times[t + 1] - times[t], begin, end)
        p = to_moves * now[t + 1] / ahead[t + 1] + (1.0 - to_moves) * (1.0 - now[t + 1]) / (1.0 - ahead[t + 1])
        now[t] = min(max(now[t] * p, 0.0), 1.0)
    return now, -np.expm1(min(log_stands - log_total, 0.0))


@kernel
def _smooth_states(first, times, ratio, start, ever, begin, end, p_moving):  # type: ignore[no-untyped-def]
    for k in range(len(start)):
        rows = slice(first[k], first[k + 1])
        if rows.stop > rows.start:
            p_moving[rows], ever[k] = _smoothed(times[rows], ratio[rows], start[k], ever[k], begin, end)
