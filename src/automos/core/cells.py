"""Cells, azimuths and moved points from coordinates, in compiled kernels."""

import numpy as np

from automos.core.kernels import kernel


@kernel
def whole_below(x):  # type: ignore[no-untyped-def]
    """Return the floor of `x` as int64, 0 if it does not fit or is not a number."""
    return np.int64(np.floor(x)) if abs(x) < 1e15 else np.int64(0)


@kernel
def moved(T, x, y, z):  # type: ignore[no-untyped-def]
    """Return where `T` (4, 4) or (3, 4) leads a point, in the types of both."""
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@kernel
def sine_bin(z, r, n_bins):  # type: ignore[no-untyped-def]
    """Return the index in `BeamPattern.row_of_sine` of `n_bins` for a point of height `z` at range `r`."""
    half = np.float32((n_bins - 1) / 2)
    at = (z / max(r, np.float32(1e-6)) + np.float32(1.0)) * half
    return int(at) if np.float32(0.0) <= at < n_bins else 0  # 0, straight down, for NaN


@kernel
def _below_one(turn):  # type: ignore[no-untyped-def]
    """Return `turn` within [0, 1), 0 for NaN."""
    return min(turn, np.float32(0.9999999)) if turn > np.float32(0.0) else np.float32(0.0)


@kernel
def turn_of(x, y):  # type: ignore[no-untyped-def]
    """Return the azimuth of (x, y) as a fraction of a turn, in [0, 1), 0 at -pi, accurate to 1e-5 rad."""
    ax, ay = abs(x), abs(y)
    a = min(ax, ay) / max(max(ax, ay), np.float32(1e-9))
    s = a * a
    angle = np.float32(-0.01172120) * s + np.float32(0.05265332)
    angle = angle * s - np.float32(0.11643287)
    angle = angle * s + np.float32(0.19354346)
    angle = angle * s - np.float32(0.33262347)
    angle = (angle * s + np.float32(0.99997726)) * a
    angle = np.float32(0.5 * np.pi) - angle if ay > ax else angle
    angle = np.float32(np.pi) - angle if x < np.float32(0.0) else angle
    angle = -angle if y < np.float32(0.0) else angle
    turn = angle * np.float32(0.5 / np.pi) + np.float32(0.5)
    return _below_one(turn)


@kernel
def rough_turn_of(x, y):  # type: ignore[no-untyped-def]
    """Return a number in [0, 1) that increases with the azimuth of (x, y) from -pi; cheaper than `turn_of`."""
    share = np.float32(0.25) * (np.float32(1.0) - x / max(abs(x) + abs(y), np.float32(1e-9)))  # 0 ahead, 0.5 behind
    turn = np.float32(0.5) + share if y >= np.float32(0.0) else np.float32(0.5) - share
    return _below_one(turn)
