"""The background thread that writes decisions into the results, and what the review is worth so far."""

import logging
import threading
from collections.abc import Callable, Iterable
from queue import Empty, Queue
from typing import Any

from automos.core.errors import AutomosError, InputError
from automos.core.label_files import read_labels
from automos.evaluation.moving import Counts, count
from automos.results.run_files import RunFiles
from automos.review.ahead import Waiting
from automos.review.apply import Lost, rewrite_run, rewrite_scan
from automos.review.run_stages import Changes, RunStages
from automos.review.sample import note_quality
from automos.views.report import write_report


class Gain:
    """Counts of each scan before and after; a scan is counted again when its labels were written again."""

    def __init__(self, stages: RunStages, waiting: Waiting):
        """Begin to count, in a thread: `stages` are its own."""
        self._stages, self._waiting = stages, waiting
        self._found: dict[int, Counts] = {}
        self._now: dict[int, tuple[int, Counts]] = {}
        self._is_whole = False
        self._counting = threading.Lock()
        threading.Thread(target=self.count, daemon=True).start()

    def count(self) -> None:
        """Count all scans with truth that were not counted yet or were written since; without truth, none."""
        with self._counting:
            if self._is_whole and not self._found:
                return  # there is no truth
            try:
                for index, name in enumerate(self._stages.names):
                    self._waiting.give_way()
                    self._count_scan(index, name)
                self._is_whole = True
            except (AutomosError, OSError):
                self._is_whole = False  # a scan is being written, or gone: nothing is said of the whole

    def _count_scan(self, index: int, name: str) -> None:
        path = self._stages.folder / "predictions" / f"{name}.label"
        written = path.stat().st_mtime_ns
        if self._now.get(index, (None,))[0] == written:
            return
        truth = self._stages.frames.sequence.truth(index)
        if truth is None:
            return
        if index not in self._found:
            self._found[index] = count(self._stages.labels(index)["label"], truth)
        self._now[index] = written, count(read_labels(path, len(truth)), truth)

    def to_page(self) -> dict[str, Any] | None:
        """Return IoU `found` and `now`, in [0, 1]; None without truth, and until all scans are counted."""
        if not self._is_whole or not self._found:
            return None
        found = sum(self._found.values(), start=Counts()).scores
        now = sum((counts for _, counts in self._now.values()), start=Counts()).scores
        has_movers = found.true_dynamic + found.false_static > 0
        return {"found": found.iou, "now": now.iou} if has_movers else None


_log = logging.getLogger(__name__)

REST = 0.4
"""Seconds without a new decision after which tracks.json and run.json are written: each takes as long as a scan."""


class Writer:
    """Writes scans that a decision concerns, then tracks.json and run.json, again and again until nothing is left."""

    def __init__(self, run: RunFiles, lost: Lost, changes: Callable[[], Changes], gain: Gain, waiting: Waiting):
        """Take the run, decisions that find no track, what gives all changes as they are now, what counts the gain."""
        self._waiting = waiting
        self.problem: str | None = None
        self.is_finishing = False
        self._run, self._lost, self._changes, self._gain = run, lost, changes, gain
        self._queue: Queue[Iterable[int] | None] = Queue()
        self._is_stale = False
        threading.Thread(target=self._work, daemon=True).start()

    @property
    def waiting(self) -> int:
        """How many decisions are not in the results yet."""
        return self._queue.unfinished_tasks

    def add(self, scans: Iterable[int]) -> None:
        """Have `scans` written anew, and what is written of the run as a whole."""
        self._queue.put(scans)

    def finish(self) -> None:
        """Wait until everything is in the results, then write the report if anything was decided; one call at a time.

        Raises
        ------
        InputError
            Something could not be written. It is tried again when finishing next.
        """
        self.is_finishing = True
        try:
            self._finish()
        finally:
            self.is_finishing = False

    def _finish(self) -> None:
        if self.problem is not None:
            self._queue.put(None)
        self._queue.join()
        if self.problem is not None:
            raise InputError(f"{self.problem}; the decisions are in the log: run automos review again to apply them")
        if self._is_stale:
            fresh = RunFiles(self._run.folder, self._run.sequence)  # its tracks are read anew
            path = self._run.folder / "report.html"
            try:
                write_report(fresh, path)
            except OSError as error:
                raise InputError(f"{path} cannot be written ({error.strerror}): free some space") from error
            self._is_stale = False

    def _work(self) -> None:
        stages = RunStages(self._run.folder, self._run.sequence)  # of its own, so that looking never waits for writing
        unwritten: set[int] = set()
        while True:
            taken = self._take()
            for scans in taken:
                unwritten.update(scans or ())  # None: try again what failed before
            try:
                while unwritten:
                    self._waiting.give_way()
                    index = min(unwritten)
                    rewrite_scan(stages, index, self._changes())
                    unwritten.discard(index)
                rewrite_run(stages, self._changes(), self._lost)
                note_quality(self._run.folder)
                self._gain.count()
                self.problem, self._is_stale = None, True
            except Exception as error:  # whatever it is, the one who waits for this thread must hear of it
                self.problem = str(error) if isinstance(error, (AutomosError, OSError)) else repr(error)
                _log.exception("decisions could not be written into the results")
            for _ in taken:
                self._queue.task_done()

    def _take(self) -> list[Iterable[int] | None]:
        """Wait for something to write; return it with all that comes while decisions follow each other quickly."""
        taken = [self._queue.get()]
        while not self.is_finishing:
            try:
                taken.append(self._queue.get(timeout=REST))
            except Empty:
                break
        while not self._queue.empty():
            taken.append(self._queue.get())
        return taken
