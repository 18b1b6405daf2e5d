"""A run over many recordings: what is to be done next, by whom, and what became of it.

Every recording begins as one unit. A short one is labelled by it; a long one gets its poses, and is then cut into
units that many workers share. What is lost with a worker is done again, what cannot be done is written down with its
reason, and the others go on.
"""

import logging
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from automos.fleet.ledger import Ledger
from automos.fleet.local_pool import Executor
from automos.fleet.orders import Ended, Job, Kind, Order, Recording, Report, State, Unit
from automos.fleet.storage import is_url

_log = logging.getLogger(__name__)

Progress = Callable[[int, int, int], None]
"""Called with how many recordings are labelled, have failed, and are in the run."""

MAX_TRIES = 3
_POLL_S = 1.0
_NEXT = {Kind.START: Kind.EVIDENCE, Kind.EVIDENCE: Kind.TRACKS, Kind.TRACKS: Kind.LABELS, Kind.LABELS: Kind.RESULTS}


@dataclass
class Outcome:
    """How a run ended: recordings labelled now, those that had been before, and why others are not (name: reason).

    warned : those of the labelled ones whose labels come with warnings.
    """

    labelled: list[str] = field(default_factory=list)
    had_been: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    warned: list[str] = field(default_factory=list)
    scans: int = 0

    @property
    def n_ended(self) -> int:
        """Number of recordings that are finished or failed."""
        return len(self.labelled) + len(self.had_been) + len(self.failed)


@dataclass
class _Work:
    """The state of one recording while it is processed."""

    recording: Recording
    scans: int = 0
    left: int = 1  # units of the present kind that are not done
    tries: Counter[Unit] = field(default_factory=Counter)
    home: str | None = None
    generation: int = 0  # of its units: those of an abandoned one no longer count


def label_all(
    recordings: Iterable[Recording], job: Job, executor: Executor, ledger: Ledger, progress: Progress | None = None
) -> Outcome:
    """Label `recordings`, as many at a time as `executor` can, and return how that ended.

    Results do not depend on the executor, nor on what was lost and done again on the way.
    """
    fleet = _Fleet(list(recordings), job, executor, ledger)
    while fleet.is_busy:
        fleet.deal_out()
        for ended in executor.wait(_POLL_S) if fleet.has_orders_out else []:
            fleet.take(ended)
        ledger.tick()
        if progress is not None:
            progress(len(fleet.outcome.labelled) + len(fleet.outcome.had_been), len(fleet.outcome.failed), fleet.total)
    return fleet.outcome


class _Fleet:
    def __init__(self, recordings: list[Recording], job: Job, executor: Executor, ledger: Ledger):
        self.outcome, self.total = Outcome(), len(recordings)
        self._job, self._executor, self._ledger = job, executor, ledger
        self._work = {recording.name: _Work(recording) for recording in recordings}
        self._ready = deque((recording.name, 0, Unit()) for recording in recordings)
        self._running: dict[int, tuple[int, Order]] = {}

    @property
    def is_busy(self) -> bool:
        return bool(self._ready or self._running)

    @property
    def has_orders_out(self) -> bool:
        return bool(self._running)

    def deal_out(self) -> None:
        while self._ready and len(self._running) < self._executor.slots:
            name, generation, unit = self._ready.popleft()
            work = self._work.get(name)
            if work is None or work.generation != generation:
                continue  # the recording failed or began anew
            active = min(len(self._ready) + len(self._running) + 1, self._executor.slots)
            threads = max(1, min(self._executor.cores // active, self._executor.max_threads))
            order = Order(self._job, work.recording, unit, threads, work.home)
            work.tries[unit] += 1
            self._running[id(order)] = (generation, order)
            self._ledger.started(order, work.tries[unit])
            self._executor.submit(order)

    def take(self, ended: Ended) -> None:
        generation, order = self._running.pop(id(ended.order))
        work = self._work.get(order.recording.name)
        report = ended.report or Report(State.AGAIN, ended.loss)
        self._ledger.ended(order, report)
        if work is None or work.generation != generation:
            return
        if report.state is State.FAILED:
            self._fail(work, report.reason, report.trace)
        elif report.state is State.AGAIN:
            self._try_again(work, order, report, ended.report is None)
        elif order.unit.kind is Kind.RESULTS or (order.unit.kind is Kind.START and report.state is State.DONE):
            self._finish(work, report)
        else:
            work.scans = report.scans
            work.home = report.place if is_url(self._job.target) else None
            work.left -= 1
            if work.left == 0:
                self._go_on(work, _NEXT[order.unit.kind])

    def _try_again(self, work: _Work, order: Order, report: Report, is_lost: bool) -> None:
        tries = work.tries[order.unit]
        if tries >= MAX_TRIES:
            self._fail(work, f"{report.reason}; tried {tries} times ({order.unit})", report.trace)
            return
        _log.info("%s, %s: %s; once more", work.recording.name, order.unit, report.reason)
        if work.home is not None and not self._executor.has(work.home):
            # What it had found went with the machine.
            replacement = _Work(work.recording, tries=work.tries, generation=work.generation + 1)
            self._work[work.recording.name] = replacement
            replacement.tries[Unit()] = tries
            self._ready.appendleft((work.recording.name, replacement.generation, Unit()))
        elif is_lost:
            self._ready.appendleft((work.recording.name, work.generation, order.unit))
        else:  # let time pass
            self._ready.append((work.recording.name, work.generation, order.unit))

    def _go_on(self, work: _Work, kind: Kind) -> None:
        if kind in (Kind.EVIDENCE, Kind.LABELS):
            starts = range(0, work.scans, self._job.chunk)
            units = [Unit(kind, first, min(first + self._job.chunk, work.scans)) for first in starts]
        else:
            units = [Unit(kind)]
        work.left = len(units)
        # Before recordings that have not begun: those that have hold space on disks.
        self._ready.extendleft((work.recording.name, work.generation, unit) for unit in reversed(units))

    def _finish(self, work: _Work, report: Report) -> None:
        name = work.recording.name
        (self.outcome.labelled if report.is_fresh else self.outcome.had_been).append(name)
        self.outcome.warned += [name] if report.warnings else []
        self.outcome.scans += report.scans
        self._ledger.labelled(work.recording, replace(report, scans=report.scans or work.scans))
        del self._work[name]

    def _fail(self, work: _Work, reason: str, trace: str) -> None:
        self.outcome.failed[work.recording.name] = reason
        self._ledger.failed(work.recording, reason, trace)
        del self._work[work.recording.name]
