"""Background tasks of a stream: estimating the timing of sweeps, or the initial speed of the sensor."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from automos.core.array_sequence import ArraySequence
from automos.core.blas import one_blas_thread
from automos.core.scan import Pose, Scan, Sequence
from automos.odometry.clock import read_clock
from automos.odometry.followed import TimedScan
from automos.odometry.one_lidar import with_one_lidar
from automos.odometry.point_order import learn_order, sees_all_round
from automos.odometry.sweep_timing import SweepTiming, recorded_duration
from automos.odometry.timing import TimingChoice, choose_timing, rear_seam
from automos.settings import OdometrySettings

_NICE = 10
Result = TypeVar("Result")


class BackgroundTask(Generic[Result]):
    """A function evaluated once, beside the stream, with its result available after a fixed delay."""

    def __init__(self, delay: float):
        """Take the delay of the result in seconds of the stream; fixed, so that results do not depend on CPU speed."""
        self._delay = delay
        self._future: Future[Result] | None = None
        self._due = math.inf

    @property
    def is_started(self) -> bool:
        """Whether the task is running or finished."""
        return self._future is not None

    def start(self, find: Callable[[], Result], now: float) -> None:
        """Start evaluating `find` at `now` seconds, unless the task was started before."""
        if self._future is None:
            worker = ThreadPoolExecutor(1, "background_task")
            self._future, self._due = worker.submit(_at_low_priority, find), now + self._delay
            worker.shutdown(wait=False)

    def is_due(self, now: float) -> bool:
        """Whether the result is used at `now` seconds."""
        return self._future is not None and now >= self._due

    def result(self, now: float) -> Result | None:
        """Return the result if it is due at `now` seconds; None before."""
        return self._future.result() if self._future is not None and now >= self._due else None


def _at_low_priority(find: Callable[[], Result]) -> Result:
    with suppress(OSError, AttributeError):  # priorities of threads exist on Linux only
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
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


def find_timing(
    last: list[tuple[TimedScan, Pose]], settings: OdometrySettings, is_compensated: bool | None
) -> TimingChoice:
    """Return the timing of sweeps, from scans with their poses in which the sensor moves."""
    sequence = _Followed([timed for timed, _ in last], is_compensated)
    return choose_timing(sequence, settings, np.array([T for _, T in last]), read_clock(sequence))


def timing_from_times(scan: Scan) -> SweepTiming | None:
    """Return the timing from a scan's own times; None without them."""
    duration = recorded_duration(scan)
    return None if duration is None else SweepTiming("file", duration=duration, share=1.0)


def usual_timing(scans: list[Scan], settings: OdometrySettings) -> SweepTiming | None:
    """Return the likely timing of sweeps, from two scans without times; None for a sensor that does not rotate."""
    sequence, _ = with_one_lidar(ArraySequence(scans), np.tile(np.eye(4), (2, 1, 1)))
    order = learn_order(sequence) if settings.time in ("auto", "order") else None
    if order is not None:
        return SweepTiming("order", turn=order.turn, share=order.span / order.turns_per_scan, order=order)
    return rear_seam() if settings.time in ("auto", "azimuth") and sees_all_round(sequence) else None
