"""Smoothed positions and velocities: a Kalman filter forwards, then a Rauch-Tung-Striebel smoother backwards.

A filter uses only the scans up to the current one. Once a track is complete, the smoother uses all of them for every
position (Rauch, Tung and Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 1965). The
model is constant velocity with white acceleration noise; the axes are independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.scan import Mask
from automos.objects.detections import Detections
from automos.objects.tracks import Tracks

NOISE = 0.15  # metres, standard deviation of a measured box centre
ACCELERATION = 1.5  # m/s per square root of a second, random walk of the velocity


def smooth_tracks(
    tracks: Tracks, is_moving: Mask, detections: Sequence[Detections], stamps: npt.NDArray[np.float64]
) -> Tracks:
    """Return `tracks` with smoothed centres and velocities of the moving ones.

    is_moving : (T,) bool, moving tracks.   detections : per scan, its segments.   stamps : (N,) seconds.
    """
    center, velocity = tracks.center.copy(), tracks.velocity.copy()
    for track in np.flatnonzero(is_moving):
        rows = tracks.rows_of(int(track))
        seen_as = zip(tracks.scan[rows], tracks.segment[rows], strict=True)
        measured = np.array([detections[i].boxes.center[k] if k >= 0 else [np.nan] * 3 for i, k in seen_as]).T.copy()
        for axis, z in enumerate(measured):
            t = stamps[tracks.scan[rows]]
            center[rows, axis], velocity[rows, axis] = smooth(t, z, NOISE**2, ACCELERATION**2)
    return replace(tracks, center=center, velocity=velocity)


@kernel(error_model="numpy")  # times may be too close to differ
def smooth(t, z, variance, jerkiness):  # type: ignore[no-untyped-def]
    """Return the smoothed position and velocity (T,) at times `t` (T,) for measurements `z` (T,), NaN where missed.

    variance : of a measurement, m^2.   jerkiness : power of the white acceleration, m^2/s^3.
    """
    # State: position x, velocity v; covariance [[a, b], [b, c]]. Scalar code compiles in a fifth of the time.
    n = len(t)
    ahead, now = np.zeros((n, 5)), np.zeros((n, 5))  # x, v, a, b, c before and after each measurement
    first = 0
    while first < n - 1 and np.isnan(z[first]):
        first += 1
    x, v, a, b, c = z[first], 0.0, 1e4, 0.0, 1e4
    for i in range(n):
        dt = t[i] - t[i - 1] if i else 0.0
        x += dt * v
        a += dt * (2.0 * b + dt * c) + jerkiness * dt**3 / 3.0
        b += dt * c + jerkiness * dt**2 / 2.0
        c += jerkiness * dt
        ahead[i, 0], ahead[i, 1], ahead[i, 2], ahead[i, 3], ahead[i, 4] = x, v, a, b, c
        if not np.isnan(z[i]):
            off, gain_x, gain_v = z[i] - x, a / (a + variance), b / (a + variance)
            x, v = x + gain_x * off, v + gain_v * off
            a, b, c = a - gain_x * a, b - gain_x * b, c - gain_v * b
        now[i, 0], now[i, 1], now[i, 2], now[i, 3], now[i, 4] = x, v, a, b, c
    for i in range(n - 2, -1, -1):
        dt = t[i + 1] - t[i]
        dx, dv = now[i + 1, 0] - ahead[i + 1, 0], now[i + 1, 1] - ahead[i + 1, 1]
        a, b, c = ahead[i + 1, 2], ahead[i + 1, 3], ahead[i + 1, 4]
        inverse = 1.0 / (a * c - b * b)
        p, q = inverse * (c * dx - b * dv), inverse * (a * dv - b * dx)
        a, b, c = now[i, 2], now[i, 3], now[i, 4]
        now[i, 0] += (a + dt * b) * p + b * q
        now[i, 1] += (b + dt * c) * p + c * q
    return now[:, 0], now[:, 1]
