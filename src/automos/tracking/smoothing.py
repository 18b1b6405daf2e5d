"""Where objects really were and how fast: Kalman filter forwards, Rauch-Tung-Striebel smoother back over it.

A filter knows of each scan only what came before. Once a track is whole, every position can draw on all of them
(Rauch, Tung and Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 1965). The model is
constant velocity, disturbed by white acceleration; the axes do not interact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numba
import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.settings import SmoothingSettings
from automos.tracking.tracks import Tracks


def smooth_tracks(
    tracks: Tracks, detections: Sequence[Detections], stamps: npt.NDArray[np.float64], settings: SmoothingSettings
) -> Tracks:
    """Return `tracks` with centres and velocities that all their observations agree on best.

    detections : per scan, its segments.   stamps : (N,) seconds.
    """
    measured = np.full((len(tracks.track), 3), np.nan)
    for row in np.flatnonzero(tracks.is_observed):
        measured[row] = detections[tracks.scan[row]].boxes.center[tracks.segment[row]]
    center, velocity = tracks.center.copy(), tracks.velocity.copy()
    for track in np.unique(tracks.track):
        rows = tracks.rows_of(track)
        t = stamps[tracks.scan[rows]]
        for axis in range(3):
            center[rows, axis], velocity[rows, axis] = smooth(
                t, np.ascontiguousarray(measured[rows, axis]), settings.noise**2, settings.acceleration**2
            )
    return replace(tracks, center=center, velocity=velocity)


@numba.njit(cache=True, nogil=True)
def smooth(t, z, variance, jerkiness):  # type: ignore[no-untyped-def]
    """Return position and velocity (T,) at times `t` (T,) that `z` (T,) suggests: NaN where nothing was measured.

    variance : of a measurement, m^2.   jerkiness : power of the white acceleration, m^2/s^3.
    """
    n = len(t)
    mean, P = np.zeros((n, 2)), np.zeros((n, 2, 2))
    before, P_before = np.zeros((n, 2)), np.zeros((n, 2, 2))
    first = 0
    while np.isnan(z[first]):
        first += 1
    m, C = np.array([z[first], 0.0]), np.array([[1e4, 0.0], [0.0, 1e4]])
    for i in range(n):
        dt = t[i] - t[i - 1] if i else 0.0
        F = np.array([[1.0, dt], [0.0, 1.0]])
        Q = jerkiness * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        m, C = F @ m, F @ C @ F.T + Q
        before[i], P_before[i] = m, C
        if not np.isnan(z[i]):
            gain = C[:, 0] / (C[0, 0] + variance)
            m = m + gain * (z[i] - m[0])
            C = C - np.outer(gain, C[0])
        mean[i], P[i] = m, C
    for i in range(n - 2, -1, -1):
        F = np.array([[1.0, t[i + 1] - t[i]], [0.0, 1.0]])
        G = P[i] @ F.T @ np.linalg.inv(P_before[i + 1])
        mean[i] += G @ (mean[i + 1] - before[i + 1])
    return mean[:, 0], mean[:, 1]
