"""The motion of the sensor, scan by scan: one estimator, at any lag.

The timing of sweeps and the speed are beliefs about the scans whose poses are not final. They are determined in the
background from some scans, as soon as these tell, and again until they are clear. If the result differs from the
assumption, these scans are followed again, a few with every new scan, until they have caught up; then the new path
replaces the old one. Who waits longer has more scans for it.
"""

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse, se3_log
from automos.core.scan import Pose, Scan
from automos.odometry.background import DELAY, BackgroundTask, TimingSearch, timing_from_times, usual_timing
from automos.odometry.clock import RunningClock
from automos.odometry.correction import Correction
from automos.odometry.facing import ScoredPlaces
from automos.odometry.followed import Followed, Posed, Stamped, TimedScan
from automos.odometry.moving_windows import WINDOW_SCANS, WINDOWS
from automos.odometry.path import WINDOW, Path
from automos.odometry.point_order import NEARLY_ALL, SAME_TIME
from automos.odometry.settling import at_another_speed
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.timing import TimingChoice
from automos.odometry.window import Window
from automos.settings import OdometrySettings

SPEED_SCANS = 3
"""Scans in which the speed is first searched: over one step traffic explains as much as the road."""


@dataclass(frozen=True, eq=False)
class Moved:
    """Motion of the sensor up to a scan.

    Attributes
    ----------
    stamp : float
        Seconds.
    posed : Posed
        Its pose, in the world of the current path.
    refined : dict[float, (4, 4) float64]
        T_world_sensor of the last scans there, by stamp, as refined with this one.
    again : tuple[tuple[TimedScan, Posed], ...]
        Earlier scans on the path that will replace the current one; both paths start in the same world.
    T_before_now : (4, 4) float64, optional
        From the new path's world to that of the previous one, such that the last scan keeps its pose; None if the path
        was not replaced.
    """

    stamp: float
    posed: Posed
    refined: dict[float, Pose]
    again: tuple[tuple[TimedScan, Posed], ...] = ()
    T_before_now: Pose | None = None


class Odometry:
    """The motion of the sensor, scan by scan.

    Equation: window

    Attributes
    ----------
    path : Path
        The present one.
    timing_found : TimingChoice, optional
        What the choice of the timing was based on.
    """

    def __init__(
        self,
        settings: OdometrySettings,
        pool: ThreadPoolExecutor,
        timing: SweepTiming | None = None,
        is_compensated: bool | None = None,
        lag: float = 0.0,
        has_stamps: bool = True,
        beside: ThreadPoolExecutor | None = None,
    ):
        """Take a thread pool, the timing of sweeps, or None to determine it, and the seconds until a pose is needed.

        has_stamps : whether stamps were measured; else missing scans are counted.   beside : see `BackgroundTask`.
        """
        if timing is None and (is_compensated or settings.time == "none"):
            timing = SweepTiming()
        self._settings, self._pool, self._beside = settings, pool, beside or ThreadPoolExecutor(1, "beside")
        self._new_path = partial(Path, settings, lag=lag, has_stamps=has_stamps)
        self.path = self._new_path(timing or SweepTiming(), pool=pool)
        self.timing_found: TimingChoice | None = None
        self._timing_search = TimingSearch(settings, is_compensated, self._beside) if timing is None else None
        self._speed_task: BackgroundTask[Stamped | None] = BackgroundTask(self._beside)
        self._scored: ScoredPlaces = {}
        self._n, self._clock = 0, RunningClock()
        self._last = deque[tuple[TimedScan, Pose]](maxlen=None if self.path.is_patient else WINDOWS * WINDOW_SCANS)
        self._correction: Correction | None = None

    def push(self, scan: Scan, read: Callable[[], Scan] | None = None) -> Moved:
        """Return the motion of the sensor up to this scan; it is kept unless `read` gives it again."""
        stamp, gap = self._clock.tick(scan.stamp)
        timed = TimedScan(read or (lambda: scan), stamp, gap, self._clock.period)
        if self._timing_search is not None and self._n < 2:
            self._guess_timing(scan)
        again, T_before_now = self._correct()
        posed = self.path.push(timed, scan)
        self._n += 1
        if not self.path.is_patient or self._timing_search is not None or self._n <= 2:
            self._last.append((timed, posed.T_world_sensor))
        if self._correction is not None:
            self._correction.add(timed)
        self._start_tasks()
        return Moved(timed.stamp, posed, self.path.poses, tuple(again), T_before_now)

    def finish(self) -> Moved:
        """Return the motion once more, with the last poses as refined with all that is known."""
        again, T_before_now = [], None
        self.path.finish()
        if self.path.is_patient and self._n:
            if self._correction is None and self._timing_search is not None:
                self._timing_search.start(list(self._last), self.path, self._clock)
                self._correction = self._pending_correction(math.inf)
            if self._correction is not None:
                again = self._correction.advance(self._n)
                self._correction.follow(self._n)
                again += self._correction.advance(self._n)
                T_before_now = self._replace_path()
                self.path.finish()
        return Moved(self._clock.stamp, self.path.posed, self.path.poses, tuple(again), T_before_now)

    def _guess_timing(self, scan: Scan) -> None:
        """Assume the points' own times, or usual ones from the second scan on: sensors send uncompensated points."""
        timing = timing_from_times(scan) if self._settings.time in ("auto", "file") else None
        if timing is not None and self._n == 1:
            timing = replace(timing, share=timing.duration / self._clock.period)
        elif self._n == 1:
            timing = usual_timing([self._last[0][0].scan, scan], self._settings)
        if timing is not None:
            self.path.timing = timing

    def _start_tasks(self) -> None:
        """Start the background tasks for which there are enough scans."""
        is_settled = self._correction is None and not self.path.is_patient
        if is_settled and self._n >= SPEED_SCANS and not self._speed_task.is_started:
            self._speed_task = BackgroundTask(self._beside, min(DELAY, 0.5 * self._n * self._clock.period))
            find = partial(_other_speed, self.path.window, self.path.stamps, self._settings, self._scored)
            self._speed_task.start(find, self._clock.stamp)
        enough = round(WINDOW / self._clock.period)
        if self._timing_search is not None and (self._n >= enough or not self.path.is_patient):
            self._timing_search.start(list(self._last)[-enough:], self.path, self._clock)

    def _correct(self) -> tuple[list[Followed], Pose | None]:
        """Return scans registered again, and the transform of a path that replaces the current one."""
        self._correction = self._correction or self._pending_correction(self._clock.stamp)
        if self._correction is None:
            return [], None
        return self._correction.advance(), self._replace_path() if self._correction.has_caught_up else None

    def _replace_path(self) -> Pose:
        """Let the path that has caught up replace the present one; return the transform between their worlds."""
        assert self._correction is not None
        T_before_now = self.path.T_world_sensor @ inverse(self._correction.path.T_world_sensor)
        told = [(timed, posed.T_world_sensor) for timed, posed in self._correction.told]
        self._last = deque(told, maxlen=self._last.maxlen)
        self.path, self._correction, self._scored = self._correction.path, None, {}
        self.path.work_in(self._pool)
        return T_before_now

    def _pending_correction(self, now: float) -> Correction | None:
        """Return a correction if a background task has a result that changes the poses of the last scans."""
        if self._n < 2:
            return None
        if self._n == 2 and self.path.timing.share:  # from now on, the distortion of the first sweep is known
            correction = self._follow_again(list(self._last), self.path.timing, self._likeliest_start())
            correction.follow(self._n)
            return correction
        search = self._timing_search
        if search is not None and (found := search.result(now)) is not None:
            self.timing_found = found
            self._timing_search = None if found.is_final or self.path.is_patient else search
            if not _are_alike(found.timing, self.path.timing):
                self._speed_task = BackgroundTask(self._beside)  # what it finds is of the poses under another timing
                last = [(timed, T) for timed, T in self._last if timed.stamp >= search.first_stamp]
                (_, T), (second, T_second) = last[:2]
                return self._follow_again(last, found.timing, se3_log(inverse(T) @ T_second) / second.gap)
        found_speed = self._searched(now)
        return None if found_speed is None else self._go_on_from(*found_speed)

    def _likeliest_start(self) -> npt.NDArray[np.float64]:
        """Return the motion (6,) from the first scan to the second under which both, undistorted by it, fit best.

        Until they are, rings of a few beams on the ground fit best at rest. What fits hardly better changes nothing.
        """
        if len(self.path.starts) < 2:
            return self.path.twist
        first_two = list(self._last)
        tried = [self._follow_again(first_two, self.path.timing, t) for t in (self.path.twist, *self.path.starts[1:])]
        for one in tried:
            one.follow(len(first_two))
        for one in tried:
            one.advance()
        best = max((one.path for one in tried), key=lambda path: path.share)
        return best.twist if tried[0].path.share < NEARLY_ALL * best.share else self.path.twist

    def _searched(self, now: float) -> Stamped | None:
        """Return the last scans at another speed if a search has found one; the next search may begin then."""
        if not self._speed_task.is_due(now):
            return None
        found = self._speed_task.result(now)
        self._speed_task = BackgroundTask(self._beside)
        return found

    def _go_on_from(self, window: Window, stamps: list[float]) -> Correction:
        """Return a new path that goes on from the scans of `window`."""
        last = [timed for timed, _ in self._last]
        first = next(k for k, stamp in enumerate(stamps) if stamp >= last[0].stamp)  # earlier ones are forgotten
        window, stamps = window.part(first), stamps[first:]
        known = [timed for timed in last if stamps[0] <= timed.stamp <= stamps[-1]]  # a window begins anew behind a gap
        todo = [timed for timed in last if timed.stamp > stamps[-1]]
        path, timing = self._new_path(self.path.timing), self.path.timing
        path.go_on_from(window, stamps)
        posed = [Posed(T, timing, twist) for T, twist in zip(window.T_world_sensor, window.twists, strict=True)]
        return Correction(path, list(zip(known, posed, strict=True)), todo, self._pool)

    def _follow_again(
        self, last: list[tuple[TimedScan, Pose]], timing: SweepTiming, twist: npt.NDArray[np.float64]
    ) -> Correction:
        """Return a new path through the `last` scans, with an initial motion of `twist` per usual gap."""
        path = self._new_path(timing, twist=twist, T_world_first=last[0][1])
        return Correction(path, [], [timed for timed, _ in last], self._pool)


def _other_speed(
    window: Window, stamps: list[float], settings: OdometrySettings, scored: ScoredPlaces
) -> Stamped | None:
    found = at_another_speed(window, settings, scored)
    return None if found is None else (found, stamps)


def _are_alike(a: SweepTiming, b: SweepTiming) -> bool:
    """Whether two timings differ in their last digits at most; the text of one from the file leaves out its share."""
    return str(a) == str(b) and abs(a.share - b.share) < SAME_TIME
