"""A review while it lasts: what is decided is logged at once and written into the results behind the scenes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from automos.errors import InputError
from automos.results.run_files import RunFiles
from automos.review.amendments import Amendment, append_amendments, append_verdicts, new_keys
from automos.review.apply import number_of, read_changes, reapply, scans_of
from automos.review.concerns import note_concerns
from automos.review.decisions import CHOICES, Decision, append_decisions
from automos.review.log import now
from automos.review.looking import open_sample
from automos.review.matching import cover_tracks
from automos.review.pictures import Pictures
from automos.review.places import place
from automos.review.proposals import Proposer
from automos.review.queue import Queue
from automos.review.reshaping import as_amendment, cut, join, split
from automos.review.run_stages import RunStages
from automos.review.scenes import scene
from automos.review.subjects import Subject, subject_of_amendment, subject_of_track
from automos.review.writer import Writer


class Session:
    """What there is to decide on, what was decided, and the thread that rewrites the results."""

    def __init__(
        self,
        run: RunFiles,
        progress: Callable[[str, int, int], None] = lambda name, done, total: None,
        n_looks: int | None = None,
    ) -> None:
        """Take a run; decisions made before are applied first, in case the last session was cut off.

        n_looks : looks of a random sample to draw, if a sample is to be answered.

        Raises
        ------
        InputError
            Results without stages, or a damaged log.
        """
        self.run = run
        self.stages = RunStages(run.folder, run.sequence)
        reapply(run.folder, run.sequence, progress)
        self.changes, self.lost = read_changes(self.stages)
        self.queue = Queue(self.stages, note_concerns(self.stages, False))
        self.queue.note(self.changes)
        self.pictures = Pictures(run, self.queue)
        self.writer = Writer(run, self.lost, lambda: self.changes)
        self._covering = RunStages(run.folder, run.sequence)  # of its own, so that deciding never waits for looking
        self._proposer = Proposer(self.stages)
        self._proposal: Amendment | None = None
        self.looking = None if n_looks is None else open_sample(self.stages, self.changes, n_looks, progress)
        self._has_ended = False
        self._gate = threading.Lock()  # a decision is taken whole, or waits until another or finishing is through
        self._reading = threading.Lock()

    # ------------------------------------------------------------------------------------------------- what is shown
    def overview(self) -> dict[str, Any]:
        """Return what there is to decide on, what holds most doubtful points first, and what was decided of each."""
        return {
            "name": self.run.sequence.name,
            "scans": self.stages.names,
            **self.queue.to_page(self.changes),
            "lost": [decision.sentence for decision in self.lost],
        }

    def scene(self, track: int) -> dict[str, Any]:
        """Return what the page draws of the object with id `track`.

        Raises
        ------
        InputError
            There is no such object.
        """
        with self._reading:
            return scene(self.stages, self._subject(track))

    def place(self, index: int) -> dict[str, Any]:
        """Return what the page draws of scan `index`, all around the sensor; InputError if there is none."""
        self._require_scan(index)
        with self._reading:
            return place(self.stages, index, self.changes)

    def status(self) -> dict[str, Any]:
        """Return how many decisions hold, how many are still to be written, and what went wrong if anything did."""
        decided, writer = len(self.changes.decided) + len(self.changes.amendments), self.writer
        state = {"waiting": writer.waiting, "problem": writer.problem, "finishing": writer.is_finishing}
        return {**state, "decided": decided}

    # ------------------------------------------------------------------------------------------------ what is decided
    def decide(self, tracks: Iterable[int], verdict: str) -> None:
        """Log the decision that the objects with ids `tracks` are `verdict`, and have it written into the results.

        verdict : one of `CHOICES`, or "found": what the pipeline found of each is right.

        Raises
        ------
        InputError
            There is no such object or verdict, the log cannot be written, or the review has ended.
        """
        tracks = list(tracks)
        made = {self.number(one): one for one in self.changes.amendments}
        for track in tracks:
            if track not in made:
                self._require(track)
        if verdict not in (*CHOICES, "found"):
            raise InputError(f"{verdict!r} is no verdict: decide on {', '.join(CHOICES)}")
        with self._gated(", ".join(f"object {track}" for track in tracks)):
            found = [track - 1 for track in tracks if track not in made]
            self._log_decisions(found, verdict)
            by_hand = [made[track] for track in tracks if track in made]
            if by_hand and verdict != "found":
                append_verdicts(self.run.folder, now(), {one.key: verdict for one in by_hand})
                self._reread()
            self.writer.add(scans_of(self.stages, found, by_hand))

    def _log_decisions(self, found: list[int], verdict: str) -> None:
        covers = cover_tracks(self._covering, found)
        at, key, decided = now(), self.stages.keys["tracking"], dict(self.changes.decided)
        decisions = []
        for track in found:
            was = self.stages.verdict(track)
            word = was if verdict == "found" else verdict
            decisions.append(Decision(at, track + 1, word, was, key, covers[track]))
            decided[track] = word
        append_decisions(self.run.folder, decisions)
        held = {track: word for track, word in decided.items() if word != "undo"}
        self.changes = replace(self.changes, decided=held)

    def dismiss(self, number: int) -> None:
        """Log that nothing is to be mended at the place with this number; InputError if there is none."""
        if not 0 <= number < len(self.queue.places):
            raise InputError(f"there is no place {number}")
        with self._gated(f"place {number}"):
            self.queue.dismiss(number)

    # ------------------------------------------------------------------------------------------- what is made by hand
    def propose(
        self,
        index: int | None = None,
        at: tuple[float, float] | None = None,
        boxes: dict[int, list[float]] | None = None,
        number: int | None = None,
    ) -> dict[str, Any]:
        """Return the scene of what is at a point of a scan, in drawn boxes, or at a place, followed through time.

        It is kept until it is accepted or another is proposed.

        Raises
        ------
        InputError
            Nothing is there.
        """
        with self._reading:
            if boxes:
                for scan in boxes:
                    self._require_scan(scan)
                drawn = {scan: np.array(box, np.float64) for scan, box in boxes.items()}
                self._proposal = self._proposer.in_boxes(drawn, self.changes)
            elif number is not None and 0 <= number < len(self.queue.places):
                where = self.queue.places[number]
                self._proposal = self._proposer.from_segment(
                    self.stages.index[where["scan"]], where["segment"], self.changes
                )
            elif index is not None and at is not None:
                self._require_scan(index)
                self._proposal = self._proposer.at(index, *at, self.changes)
            else:
                raise InputError("say where: a point of a scan, boxes, or a place")
            shown = scene(self.stages, subject_of_amendment(self.stages, self._proposal, 0))
            parts = self._proposal.parts
            return {**shown, "n_scans": len(parts), "points_of_it": sum(len(part.rows) for part in parts.values())}

    def accept(self, first: int, last: int, verdict: str = "moving") -> int:
        """Make the proposal an object, in scans `first` to `last`; return its id.

        Raises
        ------
        InputError
            Nothing is proposed, or nothing of it is left, or it cannot be logged.
        """
        proposal = self._proposal
        if proposal is None:
            raise InputError("nothing is proposed: click on something first")
        parts = {name: part for name, part in proposal.parts.items() if first <= self.stages.index[name] <= last}
        if not parts:
            raise InputError("nothing of it is left: its end lies before its beginning")
        if verdict not in ("moving", "static", "unknown"):
            raise InputError(f"{verdict!r} is no verdict: an object is moving, static or unknown")
        (made,) = self._make([replace(proposal, at=now(), verdict=verdict, parts=parts)])
        self._proposal = None
        return made

    def cut(self, track: int, index: int) -> list[int]:
        """Cut the object with id `track` before scan `index`; return the ids of the halves; InputError if it cannot."""
        self._require_scan(index)
        with self._reading:
            return self._make(cut(self.stages, self._whole(track), index), [track])

    def split(self, track: int, index: int, box: list[float]) -> list[int]:
        """Take what is in a box drawn in scan `index` out of an object; return two ids; InputError if it cannot."""
        self._require_scan(index)
        with self._reading:
            return self._make(split(self.stages, self._whole(track), index, np.array(box, np.float64)), [track])

    def join(self, tracks: list[int]) -> int:
        """Make one object of several; return its id; InputError if there are fewer than two."""
        if len(set(tracks)) < 2:
            raise InputError("two objects are needed to join them")
        with self._reading:
            (made,) = self._make([join(self.stages, [self._whole(track) for track in tracks])], tracks)
        return made

    def _whole(self, track: int) -> Amendment:
        if track not in {self.number(one) for one in self.changes.amendments}:
            self._require(track)
        return as_amendment(self.stages, track - 1, self.changes)

    def _make(self, amendments: list[Amendment], instead_of: Iterable[int] = ()) -> list[int]:
        """Log `amendments`, which stand for the objects `instead_of`; return their ids."""
        with self._gated("what was made by hand"):
            keys = new_keys(self.run.folder, len(amendments))
            keyed = [replace(one, key=key) for one, key in zip(amendments, keys, strict=True)]
            numbers = set(instead_of)
            gone = [one for one in self.changes.amendments if self.number(one) in numbers]
            append_amendments(self.run.folder, keyed)
            append_verdicts(self.run.folder, now(), {one.key: "undo" for one in gone})
            self._reread()
            self.writer.add(scans_of(self.stages, [], [*keyed, *gone]))
            return [self.number(one) for one in keyed]

    def number(self, amendment: Amendment) -> int:
        """Return the id of an object made by hand."""
        return number_of(self.stages, amendment) + 1

    def _reread(self) -> None:
        self.changes, _ = read_changes(self._covering)
        self.queue.note(self.changes)

    # ------------------------------------------------------------------------------------------------------- the end
    def finish(self) -> None:
        """Wait until everything is in the results, then write the report; the review goes on.

        Raises
        ------
        InputError
            Something could not be written. It is tried again when finishing next.
        """
        with self._gate:
            self.writer.finish()

    def close(self) -> None:
        """Finish, and refuse whatever is decided from now on; errors are those of `finish`."""
        self._has_ended = True  # before the gate, so that who comes late is told so at once
        self.pictures.stop()
        self.finish()

    # ----------------------------------------------------------------------------------------------------- conditions
    def _subject(self, track: int) -> Subject:
        for amendment in self.changes.amendments:
            if self.number(amendment) == track:
                return subject_of_amendment(self.stages, amendment, track)
        self._require(track)
        return subject_of_track(self.stages, track - 1)

    def _require(self, track: int) -> None:
        if not 1 <= track <= len(self.stages.tracks):
            raise InputError(f"there is no object {track}: they are numbered from 1 to {len(self.stages.tracks)}")

    def _require_scan(self, index: int) -> None:
        if not 0 <= index < len(self.stages.names):
            raise InputError(f"there is no scan {index}: they are numbered from 0 to {len(self.stages.names) - 1}")

    @contextmanager
    def _gated(self, what: str) -> Iterator[None]:
        """Hold the gate, unless the review has ended, before or while one waits for it."""
        self._require_open(what)
        with self._gate:
            self._require_open(what)
            yield

    def _require_open(self, what: str) -> None:
        if self._has_ended:
            raise InputError(
                f"this review has ended, and {what} was not decided on; run automos review again and decide there"
            )
