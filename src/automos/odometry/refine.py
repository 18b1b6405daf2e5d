"""Poses that fold the world onto itself: every scan is laid on submaps half a second to some seconds before and after.

Registering each scan to what was seen just before lets small errors add up, and traffic that keeps pace with the sensor
looks like a standing world. Over longer baselines neither holds: errors of centimetres double the walls, and what moves
is no longer where it was. All links are solved together with a weak wish for even motion, which bridges what no link
holds.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from automos.geometry import adjoint, inverse, se3_exp, se3_log
from automos.odometry.links import MIN_MATCHED, Alignment, Consistency, Window, choose_links, fit_links
from automos.odometry.submap import Fit
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

CONVERGED = 0.003
"""Metres, a round that moves no scan further is the last: a tenth of a surfel's noise."""
INFORMATION = 0.05
"""Share of a surfel's weight that is not its neighbours', which err with it."""


def refine_poses(
    window: Window,
    is_fixed: npt.NDArray[np.bool_],
    settings: OdometrySettings,
    about: Alignment,
    pool: ThreadPoolExecutor | None = None,
) -> tuple[Window, Consistency, Consistency]:
    """Return the scans at refined poses, and their consistency before and after.

    Parameters
    ----------
    window : consecutive scans.
    is_fixed : (N,) bool, scans that stay where they are (the first one does in any case).
    settings : the odometry's.
    about : how scans are laid on submaps.
    pool : threads to share the work; the result does not depend on them.
    """
    links = list(choose_links(window, about))
    seen: list[Consistency] = []
    for kernel in about.kernels:
        fits, consistency = fit_links(window, links, kernel, about, pool)
        seen.append(consistency)
        steps = _solve(window, links, fits, is_fixed, settings)
        window = window.moved(window.T_world_sensor @ se3_exp(steps))
        if np.abs(steps[:, :3]).max() < CONVERGED:
            break
    return window, seen[0], seen[-1]


def _solve(
    window: Window,
    links: list[tuple[int, int]],
    fits: list[Fit],
    is_fixed: npt.NDArray[np.bool_],
    settings: OdometrySettings,
) -> Array:
    """Return (N, 6) small motions of all scans in their own frames that suit links and even motion best."""
    from scipy.linalg import solveh_banded

    n = len(window)
    kept = [k for k, fit in enumerate(fits) if fit.n_matched >= MIN_MATCHED]
    scan, center = np.array([links[k] for k in kept], int).reshape(-1, 2).T
    H = INFORMATION * np.array([fits[k].H for k in kept]).reshape(-1, 6, 6)
    g = INFORMATION * np.array([fits[k].g for k in kept]).reshape(-1, 6)
    T = window.T_world_sensor
    A = adjoint(inverse(T[center]) @ T[scan])
    At_H = np.swapaxes(A, 1, 2) @ H
    rhs = np.zeros((n, 6))
    np.subtract.at(rhs, scan, np.einsum("kji,kj->ki", A, g))
    np.add.at(rhs, center, g)
    rows, columns, blocks = [scan, center, scan], [scan, center, center], [At_H @ A, H, -At_H]
    _add_even_motion(rows, columns, blocks, rhs, window, settings)
    held = np.where(is_fixed | (np.arange(n) == 0), 1e12, 1e-3)  # what nothing links stays where it is
    rows, columns = [*rows, np.arange(n)], [*columns, np.arange(n)]
    blocks = [*blocks, held[:, None, None] * np.eye(6)]
    bands = _to_bands(n, np.concatenate(rows), np.concatenate(columns), np.concatenate(blocks))
    return solveh_banded(bands, rhs.ravel(), lower=True, overwrite_ab=True).reshape(n, 6)


def _to_bands(n: int, rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64], blocks: Array) -> Array:
    """Return the lower bands, as scipy.linalg.solveh_banded takes them, of a symmetric matrix.

    It is the sum of (K, 6, 6) `blocks` at block `rows` and `columns`; of a pair across the diagonal, one is given.
    """
    is_upper = rows < columns
    blocks = np.where(is_upper[:, None, None], np.swapaxes(blocks, 1, 2), blocks)
    rows, columns = np.maximum(rows, columns), np.minimum(rows, columns)
    i = 6 * rows[:, None, None] + np.arange(6)[:, None]
    j = 6 * columns[:, None, None] + np.arange(6)
    band = i - j
    is_lower = band >= 0
    width = 6 * (int((rows - columns).max(initial=0)) + 1)
    flat = (band * (6 * n) + j)[is_lower]
    bands: Array = np.bincount(flat, blocks[is_lower], width * 6 * n).astype(np.float64)
    return bands.reshape(width, 6 * n)


def _add_even_motion(
    rows: list[npt.NDArray[np.int64]],
    columns: list[npt.NDArray[np.int64]],
    blocks: list[Array],
    rhs: Array,
    window: Window,
    settings: OdometrySettings,
) -> None:
    """Add, for every scan with two neighbours, that the motion before it goes on after it."""
    T, gaps = window.T_world_sensor, window.gaps
    if len(T) < 3:
        return
    steps = inverse(T[:-1]) @ T[1:]
    change = np.diff(se3_log(steps) / gaps[:, None], axis=0)
    back = adjoint(inverse(steps))
    usual = np.repeat([settings.usual_acceleration, np.radians(settings.usual_turn_acceleration_deg)], 3)
    weight = 1.0 / (usual * (window.period**2 * np.maximum(gaps[:-1], gaps[1:]))[:, None]) ** 2  # (N - 2, 6)
    per_gap = 1.0 / gaps[:, None, None]
    jacobians = {
        0: back[:-1] * per_gap[:-1],
        1: -back[1:] * per_gap[1:] - np.eye(6) * per_gap[:-1],
        2: np.eye(6) * per_gap[1:],
    }
    first = np.arange(len(change))
    for a, A in jacobians.items():
        np.subtract.at(rhs, first + a, np.einsum("kji,kj->ki", A, weight * change))
        for b, B in jacobians.items():
            if b <= a:
                rows.append(first + a)
                columns.append(first + b)
                blocks.append(np.swapaxes(A, 1, 2) @ (weight[:, :, None] * B))
