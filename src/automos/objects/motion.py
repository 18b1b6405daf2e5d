"""How a box moves: constant velocity with white acceleration, each axis by itself.

    x_t+1 = F(dt) x_t + w,  w ~ N(0, Q(dt)),    z_t = x_t[0] + e,  e ~ N(0, R)

    F = [[1, dt], [0, 1]],  Q = q [[dt^3/3, dt^2/2], [dt^2/2, dt]],  q = ACCELERATION^2,  R = NOISE^2

A filter uses only the scans up to the current one. Once a path is complete, the smoother uses all of them for every
position (Rauch, Tung and Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 1965).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
NOISE = 0.15  # metres, standard deviation of a measured box centre
ACCELERATION = 1.5  # m/s per square root of a second, random walk of the velocity
AROUND = 0.5  # seconds before and after a scan, at least, over which a way is told


def smooth_paths(
    first: Rows, times: Array, measured: Array, noise: npt.ArrayLike = NOISE**2
) -> tuple[Array, Array, Array]:
    """Return positions, velocities and the variances of velocities, (R, D) each, given all scans of each path.

    first : (P + 1,) where each path begins among the rows.   times : (R,) seconds.
    measured : (R, D) metres; NaN where a path was not observed.   noise : (R, D) or one, variance of these, m^2.
    """
    position, velocity, variance = (np.empty_like(measured) for _ in range(3))
    measured, noise = np.ascontiguousarray(measured), np.broadcast_to(noise, measured.shape).copy()
    _smooth_paths(first, times, measured, noise, ACCELERATION**2, position, velocity, variance)
    return position, velocity, variance


@kernel(error_model="numpy")  # times may be too close to differ
def smooth(t, z, variance, jerkiness):  # type: ignore[no-untyped-def]
    """Return smoothed positions, velocities and variances of velocities (T,) at times `t` (T,).

    z, variance : (T,) measured, NaN where missed, and its variance, m^2.   jerkiness : q, m^2/s^3.

    Equation: box-motion
    """
    # State: position x, velocity v; covariance [[a, b], [b, c]]. Scalar code compiles in a fifth of the time.
    n = len(t)
    ahead, now = np.zeros((2, n, 5))  # x, v, a, b, c before and after each measurement
    first = 0
    while first < n - 1 and np.isnan(z[first]):
        first += 1
    x, v, b = z[first], 0.0, 0.0
    a = c = 1e4  # nothing is known
    for i in range(n):
        dt = t[i] - t[i - 1] if i else 0.0
        x += dt * v
        a += dt * (2.0 * b + dt * c) + jerkiness * dt**3 / 3.0
        b += dt * c + jerkiness * dt**2 / 2.0
        c += jerkiness * dt
        ahead[i, 0], ahead[i, 1], ahead[i, 2], ahead[i, 3], ahead[i, 4] = x, v, a, b, c
        if not np.isnan(z[i]):
            off, gain_x, gain_v = z[i] - x, a / (a + variance[i]), b / (a + variance[i])
            x, v = x + gain_x * off, v + gain_v * off
            a, b, c = a - gain_x * a, b - gain_x * b, c - gain_v * b
        now[i, 0], now[i, 1], now[i, 2], now[i, 3], now[i, 4] = x, v, a, b, c
    for i in range(n - 2, -1, -1):
        dt = t[i + 1] - t[i]
        # Gain G = P F' (F P F' + Q)^-1; then x += G (x_after - x_ahead), P += G (P_after - P_ahead) G'.
        a, b, c = ahead[i + 1, 2], ahead[i + 1, 3], ahead[i + 1, 4]
        inverse = 1.0 / (a * c - b * b)
        p, q, r = now[i, 2] + dt * now[i, 3], now[i, 3], now[i, 3] + dt * now[i, 4]
        s = now[i, 4]
        g00, g01 = inverse * (p * c - q * b), inverse * (q * a - p * b)
        g10, g11 = inverse * (r * c - s * b), inverse * (s * a - r * b)
        dx, dv = now[i + 1, 0] - ahead[i + 1, 0], now[i + 1, 1] - ahead[i + 1, 1]
        da, db, dc = now[i + 1, 2] - a, now[i + 1, 3] - b, now[i + 1, 4] - c
        now[i, 0] += g00 * dx + g01 * dv
        now[i, 1] += g10 * dx + g11 * dv
        now[i, 2] += g00 * g00 * da + 2.0 * g00 * g01 * db + g01 * g01 * dc
        now[i, 3] += g00 * g10 * da + (g00 * g11 + g01 * g10) * db + g01 * g11 * dc
        now[i, 4] += g10 * g10 * da + 2.0 * g10 * g11 * db + g11 * g11 * dc
    return now[:, 0], now[:, 1], now[:, 4]


@kernel(error_model="numpy")
def _smooth_paths(first, times, measured, noise, jerkiness, position, velocity, variance):  # type: ignore[no-untyped-def]
    for k in range(len(first) - 1):
        rows = slice(first[k], first[k + 1])
        for axis in range(measured.shape[1]):
            z = measured[rows, axis].copy()
            x, v, of_v = smooth(times[rows], z, noise[rows, axis].copy(), jerkiness)
            position[rows, axis], velocity[rows, axis], variance[rows, axis] = x, v, of_v


@kernel
def ways_around(first, times, path, reach):  # type: ignore[no-untyped-def]
    """Return (R, 2) metres, how far bodies go from before to after each row, where `AROUND` and `reach` (R,) end.

    A body does not turn on the spot: what its centre does within half of its own length says nothing of its heading.
    """
    out = np.zeros((len(times), 2))
    for k in range(len(first) - 1):
        for i in range(first[k], first[k + 1]):
            low = high = i
            while low > first[k] and _is_near(times, path, i, low, reach[i]):
                low -= 1
            while high < first[k + 1] - 1 and _is_near(times, path, i, high, reach[i]):
                high += 1
            out[i] = path[high, :2] - path[low, :2]
    return out


@kernel
def _is_near(times, path, i, j, reach):  # type: ignore[no-untyped-def]
    """Return whether rows `i` and `j` of a path are less than `AROUND` seconds or `reach` metres apart."""
    return abs(times[i] - times[j]) < AROUND or np.hypot(path[j, 0] - path[i, 0], path[j, 1] - path[i, 1]) < reach
