"""Poses of scans as they come, by smoothing: with each new scan, those of the last seconds are refined.

A scan starts where the motion before it leads, and is aligned with submaps of the seconds before it. Then all scans of
the last `FREE` seconds are refined together: each is also aligned with what was seen after it, so that the submaps
under the newest scan are not distorted by the errors that a path without a future accumulates.

Who can wait is given more: scans are kept for as long as he waits, `WINDOW` at most, and then the missing scans, the
speed and the elevation of the beams are found in all of them, and all are refined.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from automos.core.geometry import Array, inverse, se3_exp, se3_log
from automos.core.scan import Pose, Scan
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.elevation import raised_scan
from automos.odometry.followed import Posed, TimedScan
from automos.odometry.links import MIN_MATCHED, Alignment, Consistency, Links, share_close
from automos.odometry.missing_scans import TRIED
from automos.odometry.motion import MIN_POINTS, usable_points
from automos.odometry.refine import align, first_steps, refine_poses, registered, solve_links
from automos.odometry.settling import elevation_in, settle
from automos.odometry.speed import SpeedSearch
from automos.odometry.surfels import SURFEL, surfels_of
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.window import SAME_POSE, Window
from automos.settings import OdometrySettings

FREE = 1.5
"""Seconds in which the pose of a scan is refined with every new one."""
WINDOW = 20.0
"""Seconds that are refined at once at most: many times the longest baseline."""
DOUBTFUL = 0.7
"""Of the usual share of surfels on surfaces, below which a scan may be elsewhere."""


class Path:
    """The motion of the sensor, scan by scan.

    Attributes
    ----------
    timing : SweepTiming
        Source of the point times of the scans to come.
    elevation : float
        Radians by which all beams point higher than the scans say.
    window, stamps : Window, list of float
        The last scans, and when they were taken, seconds.
    twist : (6,) float64
        Motion per usual gap at the newest scan.
    share : float
        Of the surfels of a scan, about how many fitted in the last ones.
    starts : list of (6,) float64
        Motions per usual gap from the first scan to the second that may be, likeliest first.
    empty : list of float
        Stamps of scans with too few points to align.
    missing : dict[float, float]
        Gaps that were counted, in periods, by the stamp of the scan after them.
    searches, consistency : lists
        Of each window that was refined as a whole.
    """

    def __init__(
        self,
        settings: OdometrySettings,
        timing: SweepTiming,
        lag: float = 0.0,
        pool: ThreadPoolExecutor | None = None,
        has_stamps: bool = True,
        twist: Array | None = None,
        T_world_first: Pose | None = None,
    ):
        """Take the seconds until a pose is needed, threads, and the initial (6,) motion per usual gap and pose.

        has_stamps : otherwise, missing scans are counted.
        The result does not depend on the threads.
        """
        self.timing, self.elevation, self.stamps = timing, 0.0, list[float]()
        self.searches, self.consistency = list[SpeedSearch](), list[Consistency]()
        self.empty, self.missing = list[float](), dict[float, float]()
        self._settings, self._pool, self._has_stamps = settings, pool, has_stamps
        self._links = Links(Alignment(), pool)
        self._wait = min(max(lag - FREE, 0.0), WINDOW)
        # With time enough, the speed and missing scans are found in windows, between which nobody needs a pose.
        self.is_patient = lag - FREE >= self.reach
        self._is_start_known, self.twist = twist is not None, np.zeros(6) if twist is None else twist
        self._T_first: Pose = np.eye(4) if T_world_first is None else T_world_first
        nothing = np.zeros((0, 6)), np.zeros((0, 4, 4)), np.zeros(0)
        self.window = Window([], *nothing, USUAL_PERIOD, 0.0)
        self._leaving, self._doubt = dict[float, Pose](), np.zeros(6)
        self.share, self.starts = 0.0, list[Array]()
        self._n_final, self._is_one = 0, True  # how many of the window's scans; whether they are of one LiDAR

    def work_in(self, pool: ThreadPoolExecutor) -> None:
        """Share the work among threads from now on."""
        self._pool = pool
        self._links.work_in(pool)

    @property
    def T_world_sensor(self) -> Pose:
        """(4, 4) pose of the newest scan."""
        return self.window.T_world_sensor[-1] if len(self.window) else self._T_first

    @property
    def posed(self) -> Posed:
        """The newest scan where it is now."""
        return Posed(self.T_world_sensor, self.timing, self.timing.share * self.twist, self._doubt)

    @property
    def poses(self) -> dict[float, Pose]:
        """(4, 4) poses that the last scan has changed, by stamp; those of earlier ones are final."""
        return self._leaving | dict(zip(self.stamps, self.window.T_world_sensor, strict=True))

    def push(self, timed: TimedScan, scan: Scan | None = None) -> Posed:
        """Return the pose of the next scan, read unless it is given; those before it are refined, see `poses`."""
        self._leaving = {}
        if self.is_patient and len(self.window) >= self._scans(self.reach + self._wait):
            self._settle()
            self._leaving = self.poses
            self._drop()
        during = self.timing.share * self.twist
        scan = raised_scan(timed.scan if scan is None else scan, self.elevation)
        self._is_one = scan.n_sensors == 1
        points, times = usable_points(scan, self.timing, during, self._settings)
        is_alone, is_empty = len(self.window) == 0, len(points) < MIN_POINTS
        step = np.eye(4) if is_alone else se3_exp(timed.gap * self.twist)
        surfels, T, no_gaps = surfels_of(points, times, self.timing.has_seam), self.T_world_sensor @ step, np.zeros(0)
        newest = Window([surfels], during[None], T[None], no_gaps, timed.period, self.timing.share)
        self.window = self.window.then([] if is_alone else [timed.gap], newest)
        self.stamps = [*self.stamps, timed.stamp]
        self.empty += [timed.stamp] if is_empty else []
        if not is_alone and not is_empty:
            T_before = self.window.T_world_sensor[-2]
            if self._align_newest() > 0.0:
                self._smooth()
            self._doubt = se3_log(inverse(T_before) @ self.window.T_world_sensor[-2])
            self._find_twist()
        if not self.is_patient:
            self._drop()
        return self.posed

    def finish(self) -> None:
        """Refine the last scans with all that is known."""
        if self.is_patient and len(self.window) > 1:
            self._settle()

    def go_on_from(self, window: Window, stamps: list[float]) -> None:
        """Go on after the scans of `window`, taken at `stamps`, as if they had been followed there."""
        self.window, self.stamps = window, stamps
        self._find_twist()
        self._drop()

    @property
    def reach(self) -> float:
        """Seconds from the newest scan to the oldest one that one whose pose is not final is aligned with."""
        return FREE + max(self._links.about.lags) + self._links.about.submap_every

    def _drop(self) -> None:
        """Drop the scans of which nothing is needed any more; whose pose is older than `FREE` is final."""
        self.window = self._recent()
        self.stamps = self.stamps[-len(self.window) :]
        self._n_final = max(len(self.window) - self._scans(FREE), 0)
        self._links.forget(self.window.first)

    def _scans(self, seconds: float) -> int:
        return max(round(seconds / self.window.period), 2)  # however rarely scans come, one is aligned with another

    def _find_twist(self) -> None:
        self.twist = _last_twist(self.window)

    def _align_newest(self) -> float:
        """Align the newest scan from where it may be, after as many scans; return its share of surfels on surfaces."""
        window = self._recent()
        tried = [self._aligned_from(window, window.T_world_sensor[-1], window.gaps[-1])]
        is_second = len(self.window) + self.window.first == 2 and not self._is_start_known
        if is_second or tried[0][1] < DOUBTFUL * self.share:
            fastest = min(self._settings.max_speed * window.period, self._links.about.max_distance)
            starts = first_steps(window.T_world_sensor[-2], fastest) if is_second else [registered(window)]
            gaps = window.gaps[-1:] if is_second or self._has_stamps else TRIED
            tried += [self._aligned_from(window, start, gap) for start in starts for gap in gaps]
        tried.sort(key=lambda one: -one[1])
        found, share = tried[0]
        self._take(found)
        if is_second:
            for twist in [_last_twist(part) for part, of_part in tried if of_part > DOUBTFUL * share]:
                self.starts += [twist] if _is_other(twist, self.starts) else []
        self.share = 0.5 * (self.share + share) if self.share else share
        return share

    def _recent(self) -> Window:
        """Return the part of the window that a new scan may change or is aligned with."""
        return self.window.part(max(len(self.window) - self._scans(self.reach), 0))

    def _take(self, part: Window) -> None:
        """Replace the last scans of the window by `part`."""
        k = len(self.window) - len(part)
        self.window = self.window.part(0, k).then(self.window.gaps[max(k - 1, 0) : k], part)

    def _aligned_from(self, window: Window, guess: Pose, gap: float) -> tuple[Window, float]:
        """Return the window with the newest scan aligned with the submaps before it, and its share of close surfels."""
        T = window.T_world_sensor.copy()
        T[-1] = guess
        window = replace(window, gaps=np.append(window.gaps[:-1], gap)).moved(T)
        n, links = len(T), self._links
        chosen = links.choose(window, [window.first + n - 1])
        for kernel in links.about.kernels:
            fits = links.fit(window, chosen, kernel)
            if max((fit.n_matched for fit in fits), default=0) < MIN_MATCHED:
                return window, 0.0
            window, moved = solve_links(window, chosen, fits, self._settings, n - 1)
            if moved < SAME_POSE:
                break
        return window, share_close(links.fit(window, chosen, links.about.kernels[-1]))

    def _smooth(self) -> None:
        """Refine the scans of the last seconds."""
        window = self._recent()
        n_fixed = max(len(window) - self._scans(FREE), 1)
        self._take(align(window, self._settings, self._links, n_fixed, self._links.about.kernels[1:])[0])

    def _settle(self) -> None:
        """Refine the window with all that is found in it."""
        n_known = max(self._n_final, 1)
        found = settle(self.window, n_known, self._links, self._settings, self._pool, self._has_stamps)
        window, consistency = found.window, found.consistency
        if not self._has_stamps:
            self.missing |= {s: gap for s, gap in zip(self.stamps[1:], window.gaps.tolist(), strict=True) if gap != 1.0}
        if self._is_one and not self.elevation and (angle := elevation_in(window, self._pool)):
            self.elevation, self._links = angle, Links(self._links.about, self._pool)
            window = replace(window, surfels=[of_scan.raised(angle) for of_scan in window.surfels])
            window, consistency = refine_poses(window, self._settings, self._links, n_known)
        self.window = window
        self.searches.append(found.search)
        self.consistency.append(consistency)
        self._find_twist()


def _is_other(start: Array, others: list[Array]) -> bool:
    """Return whether a motion (6,) to the second scan is none of `others`, to half a surfel."""
    return all(np.linalg.norm((start - other)[:3]) > 0.5 * SURFEL for other in others)


def _last_twist(window: Window) -> Array:
    """Return the motion (6,) per usual gap to the newest scan."""
    before, last = window.T_world_sensor[-2:]
    return se3_log(inverse(before) @ last) / window.gaps[-1]
