"""A review while it lasts: decisions are logged at once and written into the results behind the scenes."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from queue import Queue
from typing import Any

from automos.errors import AutomosError, InputError
from automos.export.run_files import RunFiles
from automos.review.apply import reapply, rewrite_run, rewrite_scan, scans_of
from automos.review.decisions import CHOICES, Decision, append_decision, now, read_decisions
from automos.review.matching import cover_track, match
from automos.review.run_stages import RunStages
from automos.review.scenes import scene
from automos.tracking.verdict import Verdict
from automos.visualization.report import write_report
from automos.visualization.survey import doubt, track_row

_log = logging.getLogger(__name__)


class Session:
    """Tracks to decide on, what was decided of them, and the thread that rewrites the results."""

    def __init__(
        self, run: RunFiles, progress: Callable[[str, int, int], None] = lambda name, done, total: None
    ) -> None:
        """Take a run; decisions made before are applied first, in case the last session was cut off.

        Raises
        ------
        InputError
            Results without stages, or a damaged log.
        """
        self.run = run
        self.stages = RunStages(run.folder, run.sequence)
        reapply(run.folder, run.sequence, progress)
        self.decided, self.lost = match(self.stages, read_decisions(run.folder))
        self.problem: str | None = None
        self._gate = threading.Lock()  # a decision is taken whole, or waits until another or finishing is through
        self._has_ended = False
        self._reading = threading.Lock()
        self._deciding = threading.Lock()
        self._queue: Queue[int | None] = Queue()
        self._is_stale = False
        self._writer = threading.Thread(target=self._write_decided, daemon=True)
        self._writer.start()

    # ------------------------------------------------------------------------------------------------- what is shown
    def overview(self) -> dict[str, Any]:
        """Return the tracks, those first that the pipeline was least certain of, and what was decided of each."""
        tracks = []
        for track in self.run.tracks_file["tracks"]:
            found = track.get("found", track)
            tracks.append({**track, "verdict": found["verdict"], "confidence": found["confidence"]})
        rows = [track_row(track) for track in sorted(tracks, key=doubt)]
        with self._deciding:
            decided = dict(self.decided)
        return {
            "name": self.run.sequence.name,
            "scans": len(self.run),
            "tracks": [{**row, "decided": decided.get(row["id"] - 1)} for row in rows],
            "lost": [decision.sentence for decision in self.lost],
        }

    def scene(self, track: int) -> dict[str, Any]:
        """Return what the page draws of the track with id `track`.

        Raises
        ------
        InputError
            There is no such track.
        """
        self._require(track)
        with self._reading:
            return scene(self.stages, track - 1)

    def status(self) -> dict[str, Any]:
        """Return how many decisions hold, how many are still to be written, and what went wrong if anything did."""
        return {"waiting": self._queue.unfinished_tasks, "problem": self.problem, "decided": len(self.decided)}

    # ------------------------------------------------------------------------------------------------ what is decided
    def decide(self, track: int, verdict: str) -> None:
        """Log the decision that the track with id `track` is `verdict`, and have it written into the results.

        Raises
        ------
        InputError
            There is no such track or verdict, the log cannot be written, or the review has ended.
        """
        self._require(track)
        if verdict not in CHOICES:
            raise InputError(f"{verdict!r} is no verdict: decide on {', '.join(CHOICES)}")
        self._require_open(track)
        with self._gate:
            self._require_open(track)
            with self._reading:
                covers = cover_track(self.stages, track - 1)
            found = Verdict(self.stages.verdicts.verdict[track - 1]).name.lower()
            decision = Decision(now(), track, verdict, found, self.stages.keys["tracking"], covers)
            append_decision(self.run.folder, decision)
            with self._deciding:
                if verdict == "undo":
                    self.decided.pop(track - 1, None)
                else:
                    self.decided[track - 1] = verdict
            self._queue.put(track - 1)

    def finish(self) -> None:
        """Wait until every decision is in the results, then write the report if any was made; the review goes on.

        Raises
        ------
        InputError
            Something could not be written. It is tried again when finishing next.
        """
        with self._gate:
            self._finish()

    def close(self) -> None:
        """Finish, and refuse whatever is decided from now on.

        Raises
        ------
        InputError
            Something could not be written.
        """
        self._has_ended = True  # before the gate, so that who comes late is told so at once
        with self._gate:
            self._finish()

    def _finish(self) -> None:
        if self.problem is not None:
            self._queue.put(None)
        self._queue.join()
        if self.problem is not None:
            raise InputError(f"{self.problem}; the decisions are in the log: run automos review again to apply them")
        if self._is_stale:
            fresh = RunFiles(self.run.folder, self.run.sequence)  # its tracks are read anew
            path = self.run.folder / "report.html"
            try:
                write_report(fresh, path)
            except OSError as error:
                raise InputError(f"{path} cannot be written ({error.strerror}): free some space") from error
            self._is_stale = False

    def _require(self, track: int) -> None:
        if not 1 <= track <= len(self.stages.tracks):
            raise InputError(f"there is no object {track}: they are numbered from 1 to {len(self.stages.tracks)}")

    def _require_open(self, track: int) -> None:
        if self._has_ended:
            raise InputError(
                f"this review has ended, and object {track} was not decided on; run automos review again and decide "
                "there"
            )

    def _write_decided(self) -> None:
        stages = RunStages(self.run.folder, self.run.sequence)  # of its own, so that looking never waits for writing
        unwritten: set[int] = set()
        while True:
            taken = [self._queue.get()]
            while not self._queue.empty():
                taken.append(self._queue.get())
            unwritten.update(track for track in taken if track is not None)  # None: try again what failed before
            with self._deciding:
                decided = dict(self.decided)
            try:
                for i in scans_of(stages, unwritten):
                    rewrite_scan(stages, i, decided)
                rewrite_run(stages, decided, self.lost)
                unwritten.clear()
                self.problem, self._is_stale = None, True
            except Exception as error:  # whatever it is, the one who waits for this thread must hear of it
                self.problem = str(error) if isinstance(error, (AutomosError, OSError)) else repr(error)
                _log.exception("decisions could not be written into the results")
            for _ in taken:
                self._queue.task_done()
