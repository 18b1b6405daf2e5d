"""By how much all beams of the sensor point too low, from a recording in which it moves.

Surfels are compared with submaps seconds away, as for the poses, with one more unknown: if beams pointed higher, what
is seen from far would rise by more than what is seen from near. Each comparison is free to move the scan, so that no
error of the path is taken for one of the beams. Steep beams are left out: an error of theirs that others do not share
(of the height or the range of single lasers) is as large there.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from automos.core.geometry import Array
from automos.odometry.links import Alignment, Links
from automos.odometry.refine import INFORMATION
from automos.odometry.window import ROUNDS, Window

STEEP = 8.0
"""Metres from the sensor's axis within which beams that see the ground are steep."""
SCANS = 100
"""Scans that are compared, those of the longest path."""
ABOUT = Alignment(with_elevation=True)
CERTAIN = 5.0
"""Standard errors from which an estimate is not that of a sensor without an offset."""


def find_elevation(window: Window, pool: ThreadPoolExecutor | None = None) -> float:
    """Return the radians by which all beams point higher than the surfels of a `window` say; 0 unless that is clear."""
    angle, flat = 0.0, [s[np.hypot(*s.mean[:, :2].T) > STEEP] for s in window.surfels]
    for _ in range(ROUNDS):
        step, error = _estimate(replace(window, surfels=[surfels.raised(angle) for surfels in flat]), pool)
        angle += step
    return angle if abs(angle) > CERTAIN * error else 0.0


def longest_path(positions: Array) -> slice:
    """Return which `SCANS` successive scans at `positions` (N, 3) the sensor travels farthest in."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    n = min(SCANS, len(way))
    first = int(np.argmax(way[n - 1 :] - way[: len(way) - n + 1]))
    return slice(first, first + n)


def _estimate(window: Window, pool: ThreadPoolExecutor | None) -> tuple[float, float]:
    """Return the radians by which beams point higher, to first order, and the standard error."""
    links = Links(ABOUT, pool)
    fits = links.fit(window, links.choose(window), ABOUT.kernels[0])
    information = gradient = 0.0
    for fit in fits:
        of_pose = fit.H[:6, :6] + 1e-6 * np.trace(fit.H[:6, :6]) * np.eye(6)
        if fit.n_matched:
            moved = np.linalg.solve(of_pose, fit.H[:6, 6])
            information += INFORMATION * (fit.H[6, 6] - moved @ fit.H[:6, 6])
            gradient += INFORMATION * (fit.g[6] - moved @ fit.g[:6])
    return (-gradient / information, information**-0.5) if information > 0.0 else (0.0, np.inf)
