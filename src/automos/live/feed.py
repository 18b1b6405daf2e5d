"""Sources of scans: a thread that receives them, room for the latest, and a recording replayed at its own rate."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import replace

from automos.core.errors import AutomosError, InputError
from automos.core.scan import Scan, Sequence
from automos.odometry.clock import USUAL_PERIOD

ROOM = 4
"""Scans that wait, all but one for pushes that take longer than a sensor's period now and then: what keeps up on
average leaves none out; what does not, labels scans that are three periods older."""


class Latest:
    """The latest scans that nobody has taken yet, `ROOM` at most.

    Attributes
    ----------
    left_out : scans that others came after before they were taken.
    offered : scans that were put in.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._scans: deque[Scan] = deque(maxlen=ROOM)
        self._is_closed = False
        self.left_out, self.offered = 0, 0

    def put(self, scan: Scan, wait: bool = False) -> None:
        """Put a scan in; where it is full the oldest is left out, or `wait`ed for. After `close` none is taken."""
        with self._changed:
            while wait and len(self._scans) == ROOM and not self._is_closed:
                self._changed.wait()
            if self._is_closed:
                return
            self.offered += 1
            self.left_out += len(self._scans) == ROOM
            self._scans.append(scan)
            self._changed.notify_all()

    def take(self, seconds: float) -> Scan | None:
        """Return the oldest of them, None if none comes within `seconds` or none will come any more."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans or self._is_closed, seconds)
            scan = self._scans.popleft() if self._scans else None
            self._changed.notify_all()
            return scan

    def close(self) -> None:
        """Say that no more scans come; those that are left can still be taken."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    @property
    def is_empty(self) -> bool:
        """Whether no scan waits to be taken."""
        with self._changed:
            return not self._scans

    @property
    def is_over(self) -> bool:
        """Whether it is closed and empty."""
        with self._changed:
            return self._is_closed and not self._scans


class Feed:
    """A thread that receives scans; a context that ends it. What goes wrong in it is raised by `take`."""

    name: str = "feed"
    is_compensated: bool | None = False
    recording: Sequence | None = None
    """What is replayed; None of a sensor that sends."""

    def __init__(self) -> None:
        self.latest = Latest()
        self._stop = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._receive, name="automos-live", daemon=True)

    def receive(self) -> None:
        """Put scans into `latest` until there are no more, or `_stop` is set."""
        raise NotImplementedError

    def summary(self) -> str:
        """Return a sentence on other data that arrived; empty if there was none."""
        return ""

    def take(self, seconds: float) -> Scan | None:
        """Return the next scan, None if none comes within `seconds`.

        Raises
        ------
        AutomosError : what stopped the feed.
        """
        scan = self.latest.take(seconds)
        if scan is None and self._error is not None:
            raise self._error
        return scan

    @property
    def is_over(self) -> bool:
        """Whether no scan will come any more."""
        return self.latest.is_over and self._error is None

    def stop(self) -> None:
        """End the thread."""
        self._stop.set()
        self.latest.close()
        if self._thread.ident is not None:
            self._thread.join(timeout=5.0)

    def __enter__(self) -> Feed:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def _receive(self) -> None:
        try:
            self.receive()
        except (AutomosError, OSError) as error:
            self._error = error
        except Exception as error:  # what others' libraries raise at what anyone may send
            self._error = InputError(f"{self.name}: what comes cannot be read ({type(error).__name__}: {error})")
        finally:
            self.latest.close()


class Replay(Feed):
    """A recording at its own pace, as if it came from the sensor now."""

    def __init__(self, sequence: Sequence, speed: float = 1.0):
        """Take how many times as fast; 0: every scan as soon as there is room for it. None is left out.

        Raises
        ------
        InputError : such a speed cannot be kept.
        """
        super().__init__()
        if not 0.0 <= speed < math.inf:
            raise InputError(f"a replay's speed is {speed:g}: give how many times as fast, 0 for as fast as possible")
        self.name, self.is_compensated = sequence.name, sequence.is_compensated
        self.recording, self._sequence, self._speed = sequence, sequence, speed

    def receive(self) -> None:
        """Put in every scan when its time has come and there is room for it: a file waits, as no sensor does."""
        names, stamps, begin = self._sequence.names, self._sequence.stamps, time.monotonic()
        for i, name in enumerate(names):
            scan = self._sequence[i]
            stamp = None if stamps is None else float(stamps[i])
            passed = USUAL_PERIOD * i if stamps is None else float(stamps[i] - stamps[0])
            due = begin + passed / self._speed if self._speed else begin
            if self._stop.wait(max(due - time.monotonic(), 0.0)):
                return
            self.latest.put(replace(scan, stamp=stamp, name=name), wait=True)
