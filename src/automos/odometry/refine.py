"""Refinement of poses: every scan is aligned with submaps half a second to a few seconds away.

Registration to the scans just before accumulates small errors, and traffic that keeps pace with the sensor looks like a
static world. Over longer baselines, errors of centimetres produce double walls, and moving objects have left their
position. All links are solved together with a weak prior on even motion, which bridges scans without links; in windows
of some seconds, each overlapping the end of the previous one, so that memory stays that of one window.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from automos.core.geometry import Array, adjoint, inverse, se3_exp, se3_log
from automos.core.normal_equations import FIXED, NormalEquations
from automos.core.scan import Pose
from automos.odometry.clock import Clock
from automos.odometry.links import MIN_MATCHED, Alignment, Consistency, Window, choose_links, fit_links
from automos.odometry.missing_scans import count_missing, with_gaps
from automos.odometry.motion import can_be_driven
from automos.odometry.speed import SpeedSearch, is_ahead, lengthen, search_speed
from automos.odometry.submap import Fit
from automos.odometry.surfels import Surfels
from automos.settings import OdometrySettings

CONVERGED = 0.003  # metres; iterations end once no scan moves further: a tenth of a surfel's noise
INFORMATION = 0.05
"""Share of a surfel's weight that counts, since errors of neighbouring surfels are correlated."""
LOOSE = 1e-3  # prior information on every pose, which keeps scans without links in place
WINDOW = 20.0
"""Seconds of recording refined at once: many times the longest baseline."""
OVERLAP = 6.0  # seconds of it that are refined again with the next window: as long as a pose has influence
SPEED_ROUNDS = 5  # searches for the speed, at most, each from the poses of the previous one


def refine_poses(
    window: Window,
    settings: OdometrySettings,
    about: Alignment,
    pool: ThreadPoolExecutor | None = None,
    n_fixed: int = 1,
) -> tuple[Window, Consistency]:
    """Return the scans at refined poses, and how well they align; the first `n_fixed` scans keep their poses."""
    links = list(choose_links(window, about))
    for kernel in about.kernels:
        fits, consistency = fit_links(window, links, kernel, about, pool)
        window, moved = solve_links(window, links, fits, settings, n_fixed)
        if moved < CONVERGED:
            break
    return window, consistency


def solve_links(
    window: Window, links: list[tuple[int, int]], fits: list[Fit], settings: OdometrySettings, n_fixed: int = 1
) -> tuple[Window, float]:
    """Return the scans at the poses that the `fits` of `links` and even motion favour, and the greatest change (m).

    Equation: window
    """
    equations = NormalEquations(np.where(np.arange(len(window)) < n_fixed, FIXED, LOOSE))
    _add_links(equations, links, fits, window.T_world_sensor)
    _add_even_motion(equations, window, settings)
    steps = equations.solve()
    steps[:n_fixed] = 0.0  # not the last digit
    return window.moved(window.T_world_sensor @ se3_exp(steps)), float(np.abs(steps[:, :3]).max())


def _add_links(equations: NormalEquations, links: list[tuple[int, int]], fits: list[Fit], T: Pose) -> None:
    """Add the links of scans with submaps that match enough surfels."""
    kept = [k for k, fit in enumerate(fits) if fit.n_matched >= MIN_MATCHED]
    scan, center = np.array([links[k] for k in kept], int).reshape(-1, 2).T
    H = INFORMATION * np.array([fits[k].H for k in kept]).reshape(-1, 6, 6)
    g = INFORMATION * np.array([fits[k].g for k in kept]).reshape(-1, 6)
    of_scan = adjoint(inverse(T[center]) @ T[scan])
    equations.add([(center, np.tile(-np.eye(6), (len(kept), 1, 1))), (scan, of_scan)], H, g)


def _add_even_motion(equations: NormalEquations, window: Window, settings: OdometrySettings) -> None:
    """Add the prior of constant motion for every scan with two neighbours."""
    gaps = window.gaps
    if len(window) < 3:
        return
    steps = window.steps
    change = np.diff(se3_log(steps) / gaps[:, None], axis=0)
    back = adjoint(inverse(steps))
    usual = np.repeat([settings.usual_acceleration, np.radians(settings.usual_turn_acceleration_deg)], 3)
    information = 1.0 / (usual * (window.period**2 * np.maximum(gaps[:-1], gaps[1:]))[:, None]) ** 2  # (N - 2, 6)
    per_gap = 1.0 / gaps[:, None, None]
    first = np.arange(len(change))
    of_middle = -back[1:] * per_gap[1:] - np.eye(6) * per_gap[:-1]
    parts = [(first, back[:-1] * per_gap[:-1]), (first + 1, of_middle), (first + 2, np.eye(6) * per_gap[1:])]
    equations.add(parts, information, information * change)


def n_fixed_of(n_known: int) -> int:
    """Return how many of the first `n_known` scans, which were refined before, keep their poses."""
    return max(n_known // 2, 1)


def at_likely_speed(
    registered: Window, settings: OdometrySettings, pool: ThreadPoolExecutor | None, n_known: int = 0
) -> tuple[Window, SpeedSearch]:
    """Return the window at the speed that surfaces along the path or landmarks favour, and the last search.

    The steps between the first `n_known` scans stay as they are.
    """

    def free(missing: Array) -> Array:
        is_free = np.arange(len(missing)) >= n_known - 1
        return np.where(is_free[:, None], missing, 0.0)

    def longer(window: Window, missing: Array) -> Window:
        moved = window.moved(lengthen(window.T_world_sensor, missing))
        return refine_poses(moved, settings, Alignment(), pool, n_fixed_of(n_known))[0]

    def settled(window: Window, search: SpeedSearch) -> tuple[Window, SpeedSearch]:
        """Return the window at the speed to which the `search` from its poses leads, and the last search."""
        for _ in range(SPEED_ROUNDS - 1):
            if not (missing := free(search.missing)).any():
                break
            window = longer(window, missing)
            search = search_speed(window, settings, pool)
        return window, search

    first = search_speed(registered, settings, pool)
    window, search = settled(registered, first)
    # What landmarks alone propose, from the poses as registered and from those that all surfaces have led to.
    for rival, start in ((first, registered), (search, window)):
        is_possible = can_be_driven(window.T_world_sensor, window.clock)
        if is_ahead(rival.landmarks_at_rival, search.landmarks, is_possible):
            other = longer(start, free(rival.rival))
            other, found = settled(other, search_speed(other, settings, pool))
            if is_ahead(found.landmarks, search.landmarks, is_possible):
                window, search = other, found
    return window, search


class RollingRefinement:
    """Takes scans with initial poses one by one, and returns refined poses at the end.

    In the overlap of two windows, the first half keeps its poses, so that the path is continuous; the second half is
    refined again, with the later scans that it lacked.
    """

    def __init__(self, clock: Clock, share: float, settings: OdometrySettings, pool: ThreadPoolExecutor | None = None):
        """Take the clock (if it has no stamps, missing scans are counted), the sweep's share of its period, threads."""
        self._clock, self._share, self._settings, self._pool = clock, share, settings, pool
        self._length = max(round(WINDOW / clock.period), 3)
        self._overlap = min(max(round(OVERLAP / clock.period), 2), self._length - 1)
        self._surfels: list[Surfels | Future[Surfels]] = []
        self._twists: list[Array] = []
        self._poses: list[Pose] = []
        self._gaps: list[float] = []
        self._n_known = 0  # how many of these were refined before
        self._finished: list[Pose] = []
        self.gaps: list[float] = []  # of the finished scans, each to the scan before (the first has none)
        self._consistency: list[Consistency] = []
        self.searches: list[SpeedSearch] = []  # the last one in each window

    def add(self, surfels: Surfels | Future[Surfels], twist: Array, T_last_this: Pose, gap: float) -> None:
        """Add a scan: surfels, the twist of their compensation, pose in the previous scan's frame, gap to that scan."""
        if len(self._poses) == self._length:
            self._refine()
            self._keep_last(self._overlap)
        self._poses.append(self._poses[-1] @ T_last_this if self._poses else np.eye(4))
        self._surfels.append(surfels)
        self._twists.append(twist)
        self._gaps.append(gap)

    def finish(self) -> tuple[Pose, Consistency]:
        """Return the (N, 4, 4) refined poses, and how well scans align with them."""
        self._refine()
        self._keep_last(0)
        return np.array(self._finished), Consistency.concatenate(self._consistency)

    def _refine(self) -> None:
        surfels = [s.result() if isinstance(s, Future) else s for s in self._surfels]
        gaps, poses = np.array(self._gaps[1:]), np.array(self._poses)
        window = Window(surfels, np.array(self._twists), poses, gaps, self._clock.period, self._share)
        if not self._clock.has_stamps:
            is_free = np.arange(len(gaps)) >= self._n_known - 1
            counted = np.where(is_free, count_missing(window, self._settings, self._pool), gaps)
            window = window if (counted == gaps).all() else with_gaps(window, counted)
        window, search = at_likely_speed(window, self._settings, self._pool, self._n_known)
        self.searches.append(search)
        n_fixed = n_fixed_of(self._n_known)
        window, consistency = refine_poses(window, self._settings, Alignment(), self._pool, n_fixed)
        self._consistency.append(consistency)
        self._surfels, self._twists, self._gaps[1:] = list(window.surfels), list(window.twists), window.gaps.tolist()
        self._poses = list(window.T_world_sensor)

    def _keep_last(self, n: int) -> None:
        done = len(self._poses) - n
        self._finished += self._poses[:done]
        self.gaps += self._gaps[:done]
        for kept in (self._surfels, self._twists, self._poses, self._gaps):
            del kept[:done]
        self._n_known = n
