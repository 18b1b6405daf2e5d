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
    def n_labelled(self) -> int:
        """Number of recordings that are labelled, now or before."""
        return len(self.labelled) + len(self.had_been)


@dataclass
class _Work:
    """The state of one recording while it is processed; one that begins anew gets another, and this one's units end."""

    recording: Recording
    scans: int = 0
    left: int = 1  # units of the present kind that are not done
    tries: Counter[Unit] = field(default_factory=Counter)
    home: str | None = None


class Fleet:
    """Labels recordings, as many at a time as `executor` can.

    Results do not depend on the executor, nor on what was lost and done again on the way.
    """

    def __init__(self, recordings: Iterable[Recording], job: Job, executor: Executor, ledger: Ledger):
        self._outcome = Outcome()
        self._job, self._executor, self._ledger = job, executor, ledger
        self._work = {recording.name: _Work(recording) for recording in recordings}
        self._ready = deque((work, Unit()) for work in self._work.values())
        self._running: dict[int, tuple[_Work, Order]] = {}

    def run(self, progress: Progress | None = None) -> Outcome:
        """Label all, and return how that ended."""
        outcome, total = self._outcome, len(self._work)
        while self._ready or self._running:
            self._deal_out()
            for ended in self._executor.wait(_POLL_S) if self._running else []:
                self._take(ended)
            self._ledger.tick()
            if progress is not None:
                progress(outcome.n_labelled, len(outcome.failed), total)
        return outcome

    def _is_over(self, work: _Work) -> bool:
        """Return whether its recording has failed or begun anew."""
        return self._work.get(work.recording.name) is not work

    def _deal_out(self) -> None:
        while self._ready and len(self._running) < self._executor.slots:
            work, unit = self._ready.popleft()
            if self._is_over(work):
                continue
            active = min(len(self._ready) + len(self._running) + 1, self._executor.slots)
            threads = max(1, min(self._executor.cores // active, self._executor.max_threads))
            order = Order(self._job, work.recording, unit, threads, work.home)
            work.tries[unit] += 1
            self._running[id(order)] = work, order
            self._ledger.started(order, work.tries[unit])
            self._executor.submit(order)

    def _take(self, ended: Ended) -> None:
        work, order = self._running.pop(id(ended.order))
        report = ended.report or Report(State.AGAIN, ended.loss)
        self._ledger.ended(order, report)
        if self._is_over(work):
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
            anew = self._work[work.recording.name] = _Work(work.recording, tries=work.tries)
            anew.tries[Unit()] = tries
            self._ready.appendleft((anew, Unit()))
        elif is_lost:
            self._ready.appendleft((work, order.unit))
        else:  # let time pass
            self._ready.append((work, order.unit))

    def _go_on(self, work: _Work, kind: Kind) -> None:
        units, chunk = [Unit(kind)], self._job.chunk
        if kind in (Kind.EVIDENCE, Kind.LABELS):
            units = [Unit(kind, i, min(i + chunk, work.scans)) for i in range(0, work.scans, chunk)]
        work.left = len(units)
        # Before recordings that have not begun: those that have hold space on disks.
        self._ready.extendleft((work, unit) for unit in reversed(units))

    def _finish(self, work: _Work, report: Report) -> None:
        name, outcome = work.recording.name, self._outcome
        (outcome.labelled if report.is_fresh else outcome.had_been).append(name)
        outcome.warned += [name] if report.warnings else []
        outcome.scans += report.scans
        self._ledger.labelled(work.recording, replace(report, scans=report.scans or work.scans))
        del self._work[name]

    def _fail(self, work: _Work, reason: str, trace: str) -> None:
        self._outcome.failed[work.recording.name] = reason
        self._ledger.failed(work.recording, reason, trace)
        del self._work[work.recording.name]
