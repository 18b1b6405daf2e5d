"""Poses of scans as they come, by fixed-lag smoothing: with each new scan, those of the last seconds are refined.

A scan starts where the motion before it leads, and is aligned with submaps of the seconds before it. Then all scans of
the last `FREE` seconds are refined together, as in `refine`: each is also aligned with what was seen after it, so that
the submaps under the newest scan are not distorted by the errors that a path without a future accumulates.

If the newest scan does not fit, and at the start, it is registered as in `kiss`, with a larger search range.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse, se3_exp, se3_log, transform
from automos.core.scan import Pose, Scan
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.kiss import START_SCANS, UNKNOWN_MOTION, empty_map
from automos.odometry.links import MIN_MATCHED, Window, fit_links
from automos.odometry.motion import MIN_POINTS, usable_points
from automos.odometry.recent_submaps import ABOUT, RecentSubmaps
from automos.odometry.refine import CONVERGED, at_likely_speed, solve_links
from automos.odometry.registration import Icp
from automos.odometry.surfels import Surfels, surfels_of
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

FREE = 1.5
"""Seconds after which a pose is final."""
AROUND = 10
"""Scans that a scan which does not fit is registered to."""
FIRST_STEPS = np.concatenate([s * np.vstack([np.eye(6)[:2], -np.eye(6)[:2]]) for s in (0.4, 0.8, 1.2, 1.8, 2.5)])
"""Metres along the sensor's axes, starts for the second scan: a registration that starts at rest may stay there."""
DOUBTFUL = 0.7
"""Factor on the usual share of matched surfels, below which an alignment may be wrong."""
OTHER_SPEED = 0.3
"""Metres per scan from which two speeds are different."""


@dataclass(frozen=True, eq=False)
class TimedScan:
    """A scan with its stamp (seconds), its gap to the previous one in periods (0 for the first), and the period (s)."""

    scan: Scan
    stamp: float
    gap: float
    period: float


@dataclass(frozen=True, eq=False)
class Posed:
    """The pose of a scan.

    Attributes
    ----------
    T_world_sensor : (4, 4) float64
        In the path's own world.
    timing : SweepTiming
        Source of the point times.
    sweep_motion : (6,) float64
        Motion during the sweep, for its compensation.
    """

    T_world_sensor: Pose
    timing: SweepTiming
    sweep_motion: npt.NDArray[np.float64]


class FixedLag:
    """The motion of the sensor, scan by scan.

    Attributes
    ----------
    timing : SweepTiming
        Source of the point times of the scans to come.
    stamps : list of float
        Seconds, of the last scans.
    """

    def __init__(
        self,
        settings: OdometrySettings,
        timing: SweepTiming,
        twist: Array | None = None,
        T_world_first: Pose | None = None,
        pool: ThreadPoolExecutor | None = None,
    ):
        """Take the initial (6,) motion per usual gap, None if unknown, the first pose, and threads to share the work.

        The result does not depend on the threads.
        """
        self.timing, self._settings, self._pool = timing, settings, pool
        self._is_start_known, self._twist = twist is not None, np.zeros(6) if twist is None else twist
        self._T_first: Pose = np.eye(4) if T_world_first is None else T_world_first
        nothing = np.zeros((0, 6)), np.zeros((0, 4, 4)), np.zeros(0)
        self._window = Window([], *nothing, USUAL_PERIOD, 0.0)
        self.stamps: list[float] = []
        self._n = 0  # scans pushed
        self._shares = deque[float](maxlen=20)
        self._submaps = RecentSubmaps()

    @property
    def T_world_sensor(self) -> Pose:
        """(4, 4) pose of the newest scan."""
        return self._window.T_world_sensor[-1] if len(self._window) else self._T_first

    @property
    def twist(self) -> Array:
        """(6,) motion per usual gap at the newest scan."""
        return self._twist

    @property
    def poses(self) -> dict[float, Pose]:
        """(4, 4) poses of the newest scans, by stamp; those of earlier ones are final."""
        return dict(zip(self.stamps, self._window.T_world_sensor, strict=True))

    def push(self, timed: TimedScan) -> Posed:
        """Return the pose of the next scan; those of the last `FREE` seconds are refined, see `poses`."""
        share = self.timing.share
        during = share * self._twist
        points, times = usable_points(timed.scan, self.timing, during, self._settings)
        surfels = surfels_of(points, times, self.timing.has_seam)
        is_alone = len(self._window) == 0
        step = np.eye(4) if is_alone else se3_exp(timed.gap * self._twist)
        self._append(timed, surfels, during, self.T_world_sensor @ step)
        if not is_alone and len(points) >= MIN_POINTS:
            if self._align_newest() > 0.0:
                self._smooth()
            last, before = self._window.T_world_sensor[-1], self._window.T_world_sensor[-2]
            self._twist = se3_log(inverse(before) @ last) / timed.gap
        return Posed(self.T_world_sensor, self.timing, share * self._twist)

    def speed_search(self) -> Callable[[], dict[float, Array]]:
        """Return a function that finds the (6,) motion to each of the last scans, by stamp, if the speed is another.

        It may run in another thread, meanwhile.
        """
        window, stamps, settings = self._window, list(self.stamps), self._settings

        def search() -> dict[float, Array]:
            found, here = at_likely_speed(window, settings, None)
            # Surfaces around a wrong speed may lead nowhere: what lands on landmarks from a standstill is ahead then.
            at_rest = np.tile(window.T_world_sensor[-1], (len(window), 1, 1))
            at_rest[:, :3, :3] = window.T_world_sensor[:, :3, :3]
            other, there = at_likely_speed(window.moved(at_rest), settings, None)
            found = other if there.landmarks.explains_more_than(here.landmarks) else found
            change = np.linalg.norm((found.steps - window.steps)[:, :3, 3], axis=1) / window.gaps
            if change.max(initial=0.0) < OTHER_SPEED:
                return {}
            return dict(zip(stamps[1:], se3_log(found.steps) / found.gaps[:, None], strict=True))

        return search

    def _append(self, timed: TimedScan, surfels: Surfels, twist: Array, T: Pose) -> None:
        """Add a scan to the window, and drop those of which nothing is needed any more."""
        self._n += 1
        self.stamps.append(timed.stamp)
        w = self._window = replace(self._window, period=timed.period, share=self.timing.share)
        first = max(len(w) + 1 - self._scans(FREE + max(ABOUT.lags) + ABOUT.submap_every), 0)
        self.stamps = self.stamps[first:]
        self._window = replace(
            w,
            surfels=[*w.surfels, surfels][first:],
            twists=np.vstack([w.twists, twist])[first:],
            T_world_sensor=np.concatenate([w.T_world_sensor, T[None]])[first:],
            gaps=np.append(w.gaps, timed.gap)[first if len(w) else 1 :],
        )
        self._submaps.forget(first)

    def _scans(self, seconds: float) -> int:
        return max(round(seconds / self._window.period), 1)

    def _align_newest(self) -> float:
        """Align the newest scan from its predicted pose or, if it does not fit, from a wider search.

        Return the share of its surfels that lie on a surface then.
        """
        window = self._window
        T_before, expected = window.T_world_sensor[-2], window.T_world_sensor[-1]
        found, share = self._aligned_from(expected)
        usual = float(np.median(self._shares)) if self._shares else 1.0
        if (self._n <= START_SCANS and not self._is_start_known) or share <= DOUBTFUL * usual:
            guesses = [self._registered(expected)]
            if self._n == 2 and not self._is_start_known:
                guesses += [T_before @ se3_exp(first) for first in FIRST_STEPS]
            other, share_there = max((self._aligned_from(guess) for guess in guesses), key=lambda one: one[1])
            if share_there >= share:
                found, share = other, share_there
        self._shares.append(share)
        self._window = found
        return share

    def _registered(self, expected: Pose) -> Pose:
        """Return the newest pose by registration to the points of the last scans, as in KISS-ICP."""
        local_map, window = empty_map(self._settings), self._window
        for T, surfels in list(zip(window.T_world_sensor, window.surfels, strict=True))[-AROUND - 1 : -1]:
            local_map.add(transform(T, surfels.mean.astype(np.float64)), T[:3, 3])
        return Icp(local_map, UNKNOWN_MOTION).register(window.surfels[-1].mean, expected)

    def _aligned_from(self, guess: Pose) -> tuple[Window, float]:
        """Return the window with the newest scan aligned with the submaps before it, and its share of close surfels."""
        T = self._window.T_world_sensor.copy()
        T[-1] = guess
        window, n = self._window.moved(T), len(T)
        links = self._submaps.links(window, [n - 1])
        submaps = self._submaps.of(window, links)
        for kernel in ABOUT.kernels:
            fits, _ = fit_links(window, links, kernel, ABOUT, None, submaps)
            if max((fit.n_matched for fit in fits), default=0) < MIN_MATCHED:
                return window, 0.0
            window, moved = solve_links(window, links, fits, self._settings, n - 1)
            if moved < CONVERGED:
                break
        fits, _ = fit_links(window, links, ABOUT.kernels[-1], ABOUT, None, submaps)
        return window, sum(fit.n_close for fit in fits) / max(sum(fit.n_surfels for fit in fits), 1)

    def _smooth(self) -> None:
        """Refine the scans whose poses are not final."""
        window, n = self._window, len(self._window)
        n_fixed = max(n - self._scans(FREE), 1)
        links = [link for link in self._submaps.links(window, range(n)) if max(link) >= n_fixed]
        for kernel in ABOUT.kernels[1:]:
            fits, _ = fit_links(window, links, kernel, ABOUT, self._pool, self._submaps.of(window, links))
            window, moved = solve_links(window, links, fits, self._settings, n_fixed)
            if moved < CONVERGED:
                break
        self._window = window
