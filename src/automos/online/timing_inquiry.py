"""Finding out how sweeps are timed beside a stream that goes on."""

from __future__ import annotations

import os
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress

import numpy as np

from automos.array_sequence import ArraySequence
from automos.odometry.clock import read_clock
from automos.odometry.motion import SweepTiming
from automos.odometry.timing import choose_timing
from automos.scan import Scan
from automos.settings import OdometrySettings

PATIENCE = 2.0
"""Seconds of the stream after which an answer is taken over: never sooner, or labels would depend on who is fast."""
_NICE = 10


class TimingInquiry:
    """Asks once, from scans in which the sensor moves, and answers some time later."""

    def __init__(self, settings: OdometrySettings, is_compensated: bool | None):
        self._settings, self._is_compensated = settings, is_compensated
        self._asked: Future[SweepTiming] | None = None
        self._due = np.inf

    def ask(self, scans: list[Scan]) -> None:
        """Begin with `scans`, which have stamps, unless something was asked before."""
        if self._asked is None:
            worker = ThreadPoolExecutor(1, "timing")
            self._asked = worker.submit(self._choose, scans)
            self._due = float(scans[-1].stamp or 0.0) + PATIENCE
            worker.shutdown(wait=False)

    def answer(self, now: float) -> SweepTiming | None:
        """Return what was found, once `PATIENCE` is over at `now` seconds; None before."""
        return self._asked.result() if self._asked is not None and now >= self._due else None

    def _choose(self, scans: list[Scan]) -> SweepTiming:
        with suppress(OSError, AttributeError):  # Linux knows priorities of threads; elsewhere all are alike
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        sequence = ArraySequence(scans, is_compensated=self._is_compensated)
        return choose_timing(sequence, self._settings, None, read_clock(sequence)).timing


def told_by(scan: Scan) -> SweepTiming | None:
    """Return the timing that a scan's own times tell; None where it has none."""
    if scan.time is None or not scan.is_valid.any():
        return None
    duration = float(np.nanmax(scan.time))
    return SweepTiming("file", duration=duration, share=1.0) if np.isfinite(duration) and duration > 0.0 else None
