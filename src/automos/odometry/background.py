"""Background tasks of a stream: estimating the timing of sweeps, or the initial speed of the sensor."""

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from automos.core.array_sequence import ArraySequence
from automos.core.blas import one_blas_thread
from automos.core.scan import Pose, Scan, Sequence
from automos.odometry.clock import RunningClock, read_clock
from automos.odometry.followed import TimedScan
from automos.odometry.links import COARSE
from automos.odometry.moving_windows import WINDOW_SCANS, bend_of
from automos.odometry.one_lidar import with_one_lidar
from automos.odometry.path import Path
from automos.odometry.point_order import sees_all_round
from automos.odometry.submap import CLOSE
from automos.odometry.sweep_timing import SweepTiming, recorded_duration
from automos.odometry.timing import TimingChoice, choose_timing, order_timing, rear_seam
from automos.settings import OdometrySettings

DELAY = 0.5
"""Seconds of the stream until a result is used; the speed of few scans takes less, that of many twice as long."""
Result = TypeVar("Result")


class BackgroundTask(Generic[Result]):
    """A function evaluated once, beside the stream, with its result available after a fixed delay."""

    def __init__(self, beside: ThreadPoolExecutor, delay: float = DELAY):
        """Take the delay of the result in seconds of the stream; fixed, so that results do not depend on CPU speed.

        beside : of one thread, for all tasks: two at once would take the cores that the stream needs.
        """
        self._beside, self._delay = beside, delay
        self._future: Future[Result] | None = None
        self._due = math.inf

    @property
    def is_started(self) -> bool:
        """Whether the task is running or finished."""
        return self._future is not None

    def start(self, find: Callable[[], Result], now: float) -> None:
        """Start evaluating `find` at `now` seconds, unless the task was started before."""
        if self._future is None:
            self._future, self._due = self._beside.submit(_alone, find), now + self._delay

    def is_due(self, now: float) -> bool:
        """Whether the result is used at `now` seconds."""
        return self._future is not None and now >= self._due

    def result(self, now: float) -> Result | None:
        """Return the result if it is due at `now` seconds; None before."""
        return self._future.result() if self._future is not None and now >= self._due else None


def _alone(find: Callable[[], Result]) -> Result:
    # At the priority of the stream, which waits for the result once it is due, and for the interpreter's lock.
    with one_blas_thread():
        return find()


class _Followed(Sequence):
    """Scans that were followed, as a recording."""

    def __init__(self, scans: list[TimedScan], is_compensated: bool | None):
        self._scans, self._is_compensated = scans, is_compensated

    def __len__(self) -> int:
        return len(self._scans)

    def __getitem__(self, index: int) -> Scan:
        return self._scans[self._scan_number(index)].scan

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        return np.array([timed.stamp for timed in self._scans])

    @property
    def is_compensated(self) -> bool | None:
        return self._is_compensated


class TimingSearch:
    """The search for the timing of sweeps in the last scans in which the sensor moves, until one timing is clear.

    Attributes
    ----------
    first_stamp : float
        Of the scans in which it was searched last; earlier ones did not move, or are far behind.
    """

    def __init__(self, settings: OdometrySettings, is_compensated: bool | None, beside: ThreadPoolExecutor):
        self._settings, self._is_compensated, self._beside = settings, is_compensated, beside
        self._task: BackgroundTask[TimingChoice] | None = None
        self._at, self._pause = -math.inf, WINDOW_SCANS // 2  # stamp of the next search, and scans until one after it
        self.first_stamp = -math.inf

    def start(self, last: list[tuple[TimedScan, Pose]], path: Path, clock: RunningClock) -> None:
        """Start to search in the last scans of `path`, as many as tell most, if the sensor moves in them."""
        half, period, poses = WINDOW_SCANS // 2, clock.period, path.poses
        lengths = (3 * half, 2 * half, max(round(COARSE.lags[1] / period), half))
        if self._task is not None or clock.stamp < self._at:
            return
        for n in (len(last),) if path.is_patient else lengths:
            scans = [(timed, poses.get(timed.stamp, T)) for timed, T in last[-n:]]
            if len(scans) == n and bend_of(np.array([T for _, T in scans])) >= CLOSE:
                self._task = BackgroundTask(self._beside, DELAY if path.is_patient else n * period)
                self._task.start(partial(self._find, scans, None if path.is_patient else path.timing), clock.stamp)
                self._at = clock.stamp + self._pause * period
                self.first_stamp = -math.inf if path.is_patient else scans[0][0].stamp
                self._pause *= 2
                return

    def result(self, now: float) -> TimingChoice | None:
        """Return what was found if it is due at `now` seconds; once."""
        found = None if self._task is None else self._task.result(now)
        if found is not None:
            self._task = None
        return found

    def _find(self, scans: list[tuple[TimedScan, Pose]], assumed: SweepTiming | None) -> TimingChoice:
        sequence = _Followed([timed for timed, _ in scans], self._is_compensated)
        poses, clock = np.array([T for _, T in scans]), read_clock(sequence)
        return choose_timing(sequence, self._settings, poses, clock, assumed=assumed)


def timing_from_times(scan: Scan) -> SweepTiming | None:
    """Return the timing from a scan's own times; None without them."""
    duration = recorded_duration(scan)
    return None if duration is None else SweepTiming("file", duration=duration, share=1.0)


def usual_timing(scans: list[Scan], settings: OdometrySettings) -> SweepTiming | None:
    """Return the likely timing of sweeps, from two scans without times; None for a sensor that does not rotate."""
    sequence, _ = with_one_lidar(ArraySequence(scans), np.tile(np.eye(4), (2, 1, 1)))
    from_order = order_timing(sequence) if settings.time in ("auto", "order") else None
    is_by_azimuth = from_order is None and settings.time in ("auto", "azimuth") and sees_all_round(sequence)
    return rear_seam() if is_by_azimuth else from_order
