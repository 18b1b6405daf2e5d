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
from automos.core.scan import Mask, Pose
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
        equations = NormalEquations(np.where(np.arange(len(window)) < n_fixed, FIXED, LOOSE))
        _add_links(equations, links, fits, window.T_world_sensor)
        _add_even_motion(equations, window, settings)
        steps = equations.solve()
        window = window.moved(window.T_world_sensor @ se3_exp(steps))
        if np.abs(steps[:, :3]).max() < CONVERGED:
            break
    return window, consistency


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
            counted = np.where(self._is_free(gaps), count_missing(window, self._settings, self._pool), gaps)
            window = window if (counted == gaps).all() else with_gaps(window, counted)
        window, search = self._at_likely_speed(window)
        self.searches.append(search)
        window, consistency = self._refined(window)
        self._consistency.append(consistency)
        self._surfels, self._twists, self._gaps[1:] = list(window.surfels), list(window.twists), window.gaps.tolist()
        self._poses = list(window.T_world_sensor)

    def _at_likely_speed(self, registered: Window) -> tuple[Window, SpeedSearch]:
        """Return the window at the speed that surfaces along the path or landmarks favour, and the last search."""
        first = search_speed(registered, self._settings, self._pool)
        window, search = self._settle_speed(registered, first)
        # What landmarks alone propose, from the poses as registered and from those that all surfaces have led to.
        for rival, start in ((first, registered), (search, window)):
            is_possible = can_be_driven(window.T_world_sensor, window.clock)
            if is_ahead(rival.landmarks_at_rival, search.landmarks, is_possible):
                other = self._at_longer_steps(start, self._free(rival.rival))
                other, found = self._settle_speed(other, search_speed(other, self._settings, self._pool))
                if is_ahead(found.landmarks, search.landmarks, is_possible):
                    window, search = other, found
        return window, search

    def _settle_speed(self, window: Window, search: SpeedSearch) -> tuple[Window, SpeedSearch]:
        """Return the window at the speed to which the `search` from its poses leads, and the last search."""
        for _ in range(SPEED_ROUNDS - 1):
            if not (missing := self._free(search.missing)).any():
                break
            window = self._at_longer_steps(window, missing)
            search = search_speed(window, self._settings, self._pool)
        return window, search

    def _is_free(self, steps: Array) -> Mask:
        """Return (N - 1,) which of the `steps` were not refined before."""
        return np.arange(len(steps)) >= self._n_known - 1

    def _free(self, missing: Array) -> Array:
        """Return (N - 1, 3) `missing` metres, zero for steps that were refined before."""
        return np.where(self._is_free(missing)[:, None], missing, 0.0)

    def _at_longer_steps(self, window: Window, missing: Array) -> Window:
        """Return the window with `missing` (N - 1, 3) metres added to its steps, refined."""
        return self._refined(window.moved(lengthen(window.T_world_sensor, missing)))[0]

    def _refined(self, window: Window) -> tuple[Window, Consistency]:
        n_fixed = max(self._n_known // 2, 1)
        return refine_poses(window, self._settings, Alignment(), self._pool, n_fixed)

    def _keep_last(self, n: int) -> None:
        done = len(self._poses) - n
        self._finished += self._poses[:done]
        self.gaps += self._gaps[:done]
        for kept in (self._surfels, self._twists, self._poses, self._gaps):
            del kept[:done]
        self._n_known = n
