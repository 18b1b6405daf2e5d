"""Determines something in the background of a stream: how sweeps are timed, or the initial speed of the sensor."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Generic, TypeVar

from automos.array_sequence import ArraySequence
from automos.odometry.clock import read_clock
from automos.odometry.motion import SweepTiming, recorded_duration
from automos.odometry.sweep_order import learn_order
from automos.odometry.timing import choose_timing, rear_seam, sees_all_round
from automos.scan import Scan
from automos.settings import OdometrySettings

_NICE = 10
Answer = TypeVar("Answer")


class Inquiry(Generic[Answer]):
    """Something to be found out once, beside the stream, and answered some time later."""

    def __init__(self, patience: float):
        """Take the seconds of the stream after which an answer is given; never sooner, or it mattered who is fast."""
        self._patience = patience
        self._asked: Future[Answer] | None = None
        self._due = math.inf

    @property
    def is_asked(self) -> bool:
        """Whether it is being found out, or was."""
        return self._asked is not None

    def ask(self, find: Callable[[], Answer], now: float) -> None:
        """Begin at `now` seconds to find out what `find` returns, unless something was asked before."""
        if self._asked is None:
            worker = ThreadPoolExecutor(1, "inquiry")
            self._asked, self._due = worker.submit(_patiently, find), now + self._patience
            worker.shutdown(wait=False)

    def answer(self, now: float) -> Answer | None:
        """Return what was found, once its time has come at `now` seconds; None before."""
        return self._asked.result() if self._asked is not None and now >= self._due else None


def _patiently(find: Callable[[], Answer]) -> Answer:
    with suppress(OSError, AttributeError):  # Linux knows priorities of threads; elsewhere all are alike
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
    return find()


def find_timing(scans: list[Scan], settings: OdometrySettings, is_compensated: bool | None) -> SweepTiming:
    """Return how sweeps are timed, from `scans`, which have stamps and in which the sensor moves."""
    sequence = ArraySequence(scans, is_compensated=is_compensated)
    return choose_timing(sequence, settings, None, read_clock(sequence)).timing


def told_by(scan: Scan) -> SweepTiming | None:
    """Return the timing from a scan's own times; None without them."""
    duration = recorded_duration(scan)
    return None if duration is None else SweepTiming("file", duration=duration, share=1.0)


def usual_timing(scans: list[Scan], settings: OdometrySettings) -> SweepTiming | None:
    """Return how sweeps are likely timed, from two scans without times; None for a sensor that does not turn."""
    sequence = ArraySequence(scans)
    order = learn_order(sequence) if settings.time in ("auto", "order") else None
    if order is not None:
        return SweepTiming("order", turn=order.turn, share=order.span / order.turns_per_scan, order=order)
    return rear_seam() if settings.time in ("auto", "azimuth") and sees_all_round(sequence) else None
