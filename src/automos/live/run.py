"""The loop: takes the next scan and passes on labels until the feed ends or Ctrl-C."""

import logging
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType

import numpy as np

from automos.core.labels import Label
from automos.core.scan import Scan
from automos.labeler import Labeler, LabelledScan
from automos.live.feed import Feed

_log = logging.getLogger(__name__)

Sink = Callable[[Scan, LabelledScan], None]
"""Takes a scan and its labels."""

LOOK = 0.2
"""Seconds after which it is looked whether the feed is over."""
RECENT = 50
"""Scans over which their rate is told."""
REPORT_EVERY = 5.0
"""Seconds between two sentences about scans that are left out."""


@dataclass
class Tally:
    """What came of a live run.

    Attributes
    ----------
    labelled, left_out : int
        Scans.
    points, moving : int
        Points of the labelled scans, and those of them that move.
    milliseconds : deque[float]
        From when a scan was taken to when it was labelled, of the latest thousand scans.
    movers : int
        Moving objects in the latest labelled scan.
    ages : deque[tuple[float, float]]
        When the latest scans' labels were given back, and how long after they had been taken, seconds.
    """

    labelled: int = 0
    left_out: int = 0
    points: int = 0
    moving: int = 0
    milliseconds: deque[float] = field(default_factory=lambda: deque(maxlen=1000))
    movers: int = 0
    ages: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=RECENT))

    def add(self, given: LabelledScan, taken_at: float) -> None:
        """Count one more labelled scan, which was taken at a time of `time.perf_counter`."""
        now = time.perf_counter()
        self.ages.append((now, now - taken_at))
        self.movers = len(given.objects)
        self.labelled += 1
        self.points += len(given.labels)
        self.moving += int(np.count_nonzero(given.labels == Label.MOVING))

    def line(self) -> str:
        """Return how it goes: scans a second, seconds until a scan has its labels, movers, scans left out."""
        (first, _), (last, lag) = self.ages[0], self.ages[-1]
        rate = (len(self.ages) - 1) / max(last - first, 1e-9)
        return f"{rate:.1f} scans/s, lag {lag:.2f} s, {self.movers} moving, {self.left_out} of {self.offered} dropped"

    @property
    def offered(self) -> int:
        """Scans that came."""
        return self.labelled + self.left_out

    def sentence(self, name: str) -> str:
        """Return it as a sentence for a terminal."""
        share = 100.0 * self.moving / max(self.points, 1)
        spent = ""
        if self.milliseconds:
            median, p99 = np.percentile(self.milliseconds, [50, 99])
            spent = f", {median:.0f} ms a scan (99 %: {p99:.0f})"
        return (
            f"{name}: {self.labelled} scans labelled, {self.left_out} left out, {self.points:,} points, {share:.2f} % "
            f"moving{spent}"
        )


def run_live(
    feed: Feed,
    labeler: Labeler,
    sinks: Iterable[Sink],
    names: list[str] | None = None,
    report: Callable[[Tally], None] | None = None,
) -> Tally:
    """Label what `feed` brings until it is over; Ctrl-C ends it too, and what was pushed is still given back.

    Parameters
    ----------
    sinks : each is given every labelled scan, in order.
    names : is appended the name of every scan that is pushed.
    report : is called before the first and after every scan.

    Raises
    ------
    AutomosError : what stopped the feed; what was pushed has been given to the sinks then.
    """
    tally, watch = Tally(), _Watch()
    waiting: deque[tuple[Scan, float]] = deque()  # taken, when, and not given back yet: as many as the lag holds
    taken_at: deque[float] = deque()
    sinks, say = list(sinks), report or (lambda tally: None)

    def taken() -> Iterator[Scan]:
        while not feed.is_over:
            scan = feed.take(LOOK)
            if scan is not None:
                if names is not None:
                    names.append(scan.name)
                taken_at.append(time.perf_counter())
                waiting.append((scan, taken_at[-1]))
                yield scan

    def give(done: Iterable[LabelledScan]) -> None:
        for given in done:
            scan, taken = waiting.popleft()
            tally.add(given, taken)
            for sink in sinks:
                sink(scan, given)

    try:
        say(tally)
        with feed:
            for done in labeler.push_each(taken()):
                with _unbroken():
                    tally.milliseconds.append(1e3 * (time.perf_counter() - taken_at.popleft()))
                    give(done)
                tally.left_out = feed.latest.left_out
                watch.look(tally, feed.latest.offered)
                say(tally)
    except KeyboardInterrupt:
        _log.info("ended by Ctrl-C")
    finally:
        feed.stop()
        tally.left_out = feed.latest.left_out
        with _unbroken(is_end=True):
            give(labeler.finish())
    return tally


@contextmanager
def _unbroken(is_end: bool = False) -> Iterator[None]:
    """Keep Ctrl-C until the block ends, but for a second one: it is how a live run ends, and comes at any moment.

    A sink that was given half a scan has its label and not its pose, and all later ones are taken for others. What
    `is_end` already is not ended once more.
    """
    before = signal.getsignal(signal.SIGINT)
    # Other threads are never interrupted, and some callers want no interruption at all.
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    pressed: list[int] = []

    def keep(number: int, frame: FrameType | None) -> None:
        pressed.append(number)
        if len(pressed) > 1:
            before(number, frame)

    signal.signal(signal.SIGINT, keep)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed and not is_end:
        before(pressed[0], None)


class _Watch:
    """Says when scans are left out, not more often than every few seconds."""

    def __init__(self) -> None:
        self._reported, self._at = 0, -np.inf

    def look(self, tally: Tally, offered: int) -> None:
        now = time.monotonic()
        if tally.left_out > self._reported and now - self._at > REPORT_EVERY:
            _log.warning(
                "too slow: %d of %d scans were left out so far; labelling one takes %.0f ms",
                *(tally.left_out, offered, float(np.median(tally.milliseconds))),
            )
            self._reported, self._at = tally.left_out, now
