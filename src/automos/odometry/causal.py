"""Causal odometry: poses from the scans so far, and their correction by later estimates.

The timing of sweeps and the initial speed are determined in the background from some scans. If the result differs from
the assumption, the last scans are registered again, a few with every new scan, until they have caught up; then the new
path replaces the old one.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse, se3_log
from automos.core.scan import Pose, Scan
from automos.odometry.background import BackgroundTask, find_timing, timing_from_times, usual_timing
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.fixed_lag import FixedLag, Posed, TimedScan
from automos.odometry.moving_windows import MIN_BEND
from automos.odometry.sweep_timing import SAME_TIME, SweepTiming
from automos.settings import OdometrySettings

TIMING_SCANS = 16
"""Scans with motion from which the timing of sweeps is determined: fewer were unreliable."""
REMADE = 40
"""Scans that are registered again, at most."""
AT_ONCE = 8
"""Of them, per new scan: beside the stream on another core, in about the time of one scan."""
SPEED_SCANS, SPEED_DELAY = 3, 0.5
"""Scans in which the speed is first searched, and seconds until a result is used, at most: few scans take less."""
SELDOM = 4.0
"""Seconds between searches for the speed, at most: about what one sees. At first there are none, later they double."""


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


class _Correction:
    """A new path through the last scans, while it catches up."""

    def __init__(self, path: FixedLag, todo: list[TimedScan], pool: ThreadPoolExecutor):
        self.path, self._pool = path, pool
        self.made: list[tuple[TimedScan, Pose]] = []
        self._todo = deque(todo)
        self._future: Future[list[tuple[TimedScan, Posed]]] | None = None

    def advance(self) -> list[tuple[TimedScan, Posed]]:
        """Return the scans that were registered since `add`."""
        done = [] if self._future is None else self._future.result()
        self.made += [(timed, posed.T_world_sensor) for timed, posed in done]
        return done

    def add(self, timed: TimedScan) -> None:
        """Append a new scan, and start registering the next few."""
        self._todo.append(timed)
        few = [self._todo.popleft() for _ in range(min(AT_ONCE, len(self._todo)))]
        self._future = self._pool.submit(lambda: [(timed, self.path.push(timed)) for timed in few])

    def catch_up(self) -> None:
        """Start registering all remaining scans."""
        todo, self._todo = list(self._todo), deque()
        self._future = self._pool.submit(lambda: [(timed, self.path.push(timed)) for timed in todo])

    @property
    def has_caught_up(self) -> bool:
        """Whether all scans are registered once `advance` has returned."""
        return self._future is not None and not self._todo


class Odometry:
    """The motion of the sensor, scan by scan."""

    def __init__(
        self,
        settings: OdometrySettings,
        pool: ThreadPoolExecutor,
        timing: SweepTiming | None = None,
        is_compensated: bool | None = None,
    ):
        """Take a thread pool, and the timing of sweeps, or None to determine it."""
        if timing is None and (is_compensated or settings.time == "none"):
            timing = SweepTiming()
        self._settings, self._pool, self._is_compensated = settings, pool, is_compensated
        self._timing_task: BackgroundTask[SweepTiming] | None = None if timing is not None else BackgroundTask(2.0)
        self._speed_task: BackgroundTask[dict[float, npt.NDArray[np.float64]]] = BackgroundTask(SPEED_DELAY)
        self._search_at, self._pause = -np.inf, 0.0  # stamp of the next search, and seconds since the one before
        self._n, self._stamp, self._steps = 0, 0.0, deque[float](maxlen=50)
        self._last = deque[tuple[TimedScan, Pose]](maxlen=REMADE)
        self._path = FixedLag(settings, timing or SweepTiming(), pool=pool)
        self._correction: _Correction | None = None

    def push(self, scan: Scan) -> Moved:
        """Return the motion of the sensor from the last scan to this one."""
        timed = self._timed(scan)
        if self._timing_task is not None and self._n < 2:
            self._guess_timing(scan)
        again, T_before_now = self._correct()
        posed = self._path.push(timed)
        self._n += 1
        self._last.append((timed, posed.T_world_sensor))
        if self._correction is not None:
            self._correction.add(timed)
        self._start_tasks()
        return Moved(timed.stamp, posed, self._path.poses, tuple(again), T_before_now)

    def _guess_timing(self, scan: Scan) -> None:
        """Assume the points' own times, or usual ones from the second scan on: sensors send uncompensated points."""
        timing = timing_from_times(scan) if self._settings.time in ("auto", "file") else None
        if timing is None and self._n == 1:
            timing = usual_timing([self._last[0][0].scan, scan], self._settings)
        if timing is not None:
            self._path.timing = timing

    def _start_tasks(self) -> None:
        """Start the background tasks for which there are enough scans."""
        is_settled, settings = self._correction is None, self._settings
        if is_settled and not self._speed_task.is_started and self._n >= SPEED_SCANS and self._stamp >= self._search_at:
            self._speed_task = BackgroundTask(min(SPEED_DELAY, 0.5 * self._n * self._period))
            self._speed_task.start(self._path.speed_search(), self._stamp)
        if self._timing_task is not None and not self._timing_task.is_started and self._n >= TIMING_SCANS:
            last = list(self._last)[-TIMING_SCANS:]
            travelled = np.linalg.norm(np.diff([T[:3, 3] for _, T in last], axis=0), axis=1)
            if travelled.mean() >= MIN_BEND:
                moving = [replace(timed.scan, stamp=timed.stamp) for timed, _ in last]
                self._timing_task.start(lambda: find_timing(moving, settings, self._is_compensated), self._stamp)

    def _correct(self) -> tuple[list[tuple[TimedScan, Posed]], Pose | None]:
        """Return scans registered again, and the transform of a path that replaces the current one."""
        if self._correction is None:
            self._correction = self._pending_correction()
        if self._correction is None:
            return [], None
        again, T_before_now = self._correction.advance(), None
        if self._correction.has_caught_up:
            T_before_now = self._path.T_world_sensor @ inverse(self._correction.path.T_world_sensor)
            self._last = deque(self._correction.made, maxlen=REMADE)
            self._path, self._correction = self._correction.path, None
        return again, T_before_now

    def _pending_correction(self) -> _Correction | None:
        """Return a correction if a background task has a result that changes the poses of the last scans."""
        if self._n < 2:
            return None
        if self._n == 2 and self._path.timing.share:  # from now on, the distortion of the first sweep is known
            correction = self._follow_again(self._path.timing, self._path.twist)
            correction.catch_up()
            return correction
        timing = None if self._timing_task is None else self._timing_task.result(self._stamp)
        self._timing_task = self._timing_task if timing is None else None
        twists = self._searched()
        self._last = deque([one for one in self._last if one[0].stamp >= self._path.stamps[0]], maxlen=REMADE)
        is_other = timing is not None and not _are_alike(timing, self._path.timing)
        second = self._last[1]
        if second[0].stamp not in twists and not is_other:
            return None
        measured = se3_log(inverse(self._last[0][1]) @ second[1]) / second[0].gap
        return self._follow_again(timing or self._path.timing, twists.get(second[0].stamp, measured))

    def _searched(self) -> dict[float, npt.NDArray[np.float64]]:
        """Return the motion to each of the last scans, by stamp, if a search has found another; and plan the next."""
        twists = self._speed_task.result(self._stamp)
        if twists is None:
            return {}
        is_new = bool(twists) or self._n < REMADE
        self._pause = 0.0 if is_new else min(max(2.0 * self._pause, SPEED_DELAY), SELDOM)
        self._speed_task, self._search_at = BackgroundTask(SPEED_DELAY), self._stamp + self._pause
        return twists

    def _follow_again(self, timing: SweepTiming, twist: npt.NDArray[np.float64]) -> _Correction:
        """Return a new path through the last scans, with an initial motion of `twist` per usual gap."""
        path = FixedLag(self._settings, timing, twist, self._last[0][1])
        return _Correction(path, [timed for timed, _ in self._last], self._pool)

    @property
    def _period(self) -> float:
        return float(np.median(self._steps)) if self._steps else USUAL_PERIOD

    def _timed(self, scan: Scan) -> TimedScan:
        """Return the scan with its gap to the last one, and advance the clock."""
        before, gap = self._stamp, 1.0
        if self._n == 0:
            self._stamp = scan.stamp or 0.0
            return TimedScan(scan, self._stamp, 0.0, self._period)
        self._stamp = before + USUAL_PERIOD if scan.stamp is None else scan.stamp
        passed = self._stamp - before
        if passed > 0.0:  # otherwise out of order
            usual = self._period if self._steps else passed
            self._steps.append(passed)
            gap = passed / usual if passed > 1.5 * usual else 1.0
        return TimedScan(scan, self._stamp, gap, self._period)


def _are_alike(a: SweepTiming, b: SweepTiming) -> bool:
    """Whether two timings differ in their last digits at most; the text of one from the file leaves out its share."""
    return str(a) == str(b) and abs(a.share - b.share) < SAME_TIME
