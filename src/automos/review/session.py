"""A running review: what the page shows, the decisions, and the objects made by a person."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.run import Progress, silent
from automos.core.workspace import Workspace
from automos.results.run_files import RunFiles
from automos.results.run_warnings import general_sentences
from automos.review.ahead import GivenUpError, Pictures, Proposals, Shown, Waiting, What
from automos.review.amendments import Amendment
from automos.review.apply import is_applied, reapply
from automos.review.log import now
from automos.review.looking import open_sample
from automos.review.proposals import Proposer
from automos.review.record import Record
from automos.review.reshaping import as_amendment, cut, join, proposed, split
from automos.review.run_stages import RunStages
from automos.review.scenes import Subject, place, scene, subject_of_amendment, subject_of_track

NEAR = 6
"""Scans each way that are shown of something at once, while it is followed through the others."""
AHEAD = 3
"""Places made ahead: with those a person has for each the time that she looks at three others."""


class Session(Record):
    """What there is to decide on, and everything that the page may ask or say."""

    def __init__(self, run: RunFiles, progress: Progress = silent, n_looks: int | None = None):
        """Take a run; decisions made before are applied first, in case the last session was cut off.

        n_looks : looks of a random sample to draw, if a sample is to be answered.

        Raises
        ------
        InputError
            Results without stages, or a damaged log.
        """
        stages = RunStages(run.folder, run.sequence)
        if not is_applied(run.folder):
            reapply(run.folder, run.sequence, progress)
        self._waiting = Waiting()
        super().__init__(run, stages, self._waiting)
        self._pictures = Pictures(run, self.stages, self.queue, self._waiting)
        self.proposals = Proposals(self.stages, lambda: self.changes, self._waiting)
        self.looking = None if n_looks is None else open_sample(self.stages, self.changes, n_looks, progress)
        self._near = Proposer(self.stages, NEAR)
        self._reshaping = threading.Lock()  # what two people cut is cut once

    # ------------------------------------------------------------------------------------------------- what is shown
    def overview(self) -> dict[str, Any]:
        """Return what there is to decide on, what holds most doubtful points first, and what was decided of each."""
        return {
            "name": self.run.sequence.name,
            "scans": self.stages.names,
            **self.queue.to_page(self.changes),
            "sentences": general_sentences(Workspace(self.run.folder).read_run()),
        }

    def scene(self, track: int) -> dict[str, Any]:
        """Return what the page draws of the object with id `track`.

        Raises
        ------
        InputError
            There is no such object.
        """
        with self._waiting:
            return scene(self.stages, self._subject(track))

    def place(self, index: int) -> dict[str, Any]:
        """Return what the page draws of scan `index`, all around the sensor; InputError if there is none."""
        self._require_scan(index)
        with self._waiting:
            return place(self.stages, index, self.changes)

    def pictures_now(self) -> dict[str, Any]:
        """Return the pictures of the list that there are so far."""
        return self._pictures.to_page(self.changes.amendments)

    def status(self) -> dict[str, Any]:
        """Return how many decisions hold, how many are to be written, what went wrong, and the IoU before and now."""
        decided, writer = len(self.changes.decided) + len(self.changes.amendments), self.writer
        state = {"waiting": writer.waiting, "problem": writer.problem, "finishing": writer.is_finishing}
        return {**state, "decided": decided, "iou": self.gain.to_page()}

    def close(self) -> None:
        """Finish, and refuse whatever is decided from now on; errors as for `finish`."""
        self._has_ended = True  # late decisions are refused at once
        self._pictures.stop()
        self.proposals.stop()
        self.finish()

    # ------------------------------------------------------------------------------------------- what is made by hand
    def propose(
        self,
        index: int | None = None,
        at: tuple[float, float] | None = None,
        boxes: dict[int, list[float]] | None = None,
        number: int | None = None,
        is_glance: bool = False,
    ) -> dict[str, Any]:
        """Return the scene of what is at a point of a scan, in drawn boxes, or at a place, followed through time.

        It is kept until it is accepted or another is proposed. Nothing is returned once it is given up. A glance is at
        the scans around, at once; `is_whole` says whether there is more.

        Raises
        ------
        InputError
            Nothing is there.
        """
        if boxes:
            for scan in boxes:
                self._require_scan(scan)
            what: What = Proposer.in_boxes, tuple((scan, tuple(box)) for scan, box in sorted(boxes.items()))
        elif number is not None:
            what = self._what_at(number)
        elif index is not None and at is not None:
            self._require_scan(index)
            what = Proposer.at, index, *at
        else:
            raise InputError("say where: a point of a scan, boxes, or a place")
        try:
            (found, shown), is_whole = self._glance(what) if is_glance else (self.proposals.get(what), True)
        except GivenUpError:
            return {}
        points = sum(len(part.rows) for part in found.parts.values())
        return {**shown, "n_scans": len(found.parts), "points_of_it": points, "is_whole": is_whole}

    def _glance(self, what: What) -> tuple[Shown, bool]:
        """Return what is to be seen of something in the scans around, or all of it if that was made; and which it is.

        It takes as long in a recording of any length. What was asked for before is given up; errors as of `propose`.
        """
        self.proposals.cancel()
        method, *where = what
        if self.proposals.is_made(what):
            return self.proposals.get(what), True
        with self._waiting:
            try:
                found = proposed(self.stages, method(self._near, *where, lambda n: None), self.changes)
                return (found, scene(self.stages, subject_of_amendment(self.stages, found, 0))), False
            except InputError:
                if method is not Proposer.in_boxes:  # between boxes there may be something farther on
                    raise
        return self.proposals.get(what), True

    def make_ahead(self, numbers: list[int]) -> None:
        """Make what places will show, by their numbers, while nothing is waited for; InputError if there is none."""
        self.proposals.make_ahead(map(self._what_at, numbers[:AHEAD]))

    def _what_at(self, number: int) -> What:
        place = self.queue.place(number)
        return Proposer.from_segment, self.stages.index[place["scan"]], place["segment"]

    def accept(self, first: int, last: int, verdict: str = "moving") -> int:
        """Make the proposal an object, in scans `first` to `last`; return its id.

        Raises
        ------
        InputError
            Nothing is proposed, or nothing of it is left, or it cannot be logged.
        """
        asked = self.proposals.asked
        if asked is None:
            raise InputError("nothing is proposed: click on something first")
        proposal, _ = self.proposals.get(asked)  # what was decided since is taken out
        parts = {name: part for name, part in proposal.parts.items() if first <= self.stages.index[name] <= last}
        if not parts:
            raise InputError("nothing of it is left: its end lies before its beginning")
        if verdict not in ("moving", "static", "unknown"):
            raise InputError(f"{verdict!r} is not a verdict: an object is moving, static or unknown")
        (made,) = self.make([replace(proposal, at=now(), verdict=verdict, parts=parts)])
        self.proposals.cancel()
        return made

    def cut(self, track: int, index: int) -> list[int]:
        """Cut the object with id `track` before scan `index`; return the ids of the halves; InputError if it cannot."""
        self._require_scan(index)
        with self._reshaping:
            return self.make(cut(self.stages, self._whole(track), index), [track])

    def split(self, track: int, index: int, box: list[float]) -> list[int]:
        """Take what is in a box drawn in scan `index` out of an object; return two ids; InputError if it cannot."""
        self._require_scan(index)
        with self._reshaping:
            return self.make(split(self.stages, self._whole(track), index, np.array(box, np.float64)), [track])

    def join(self, tracks: list[int]) -> int:
        """Make one object of several; return its id; InputError if there are fewer than two."""
        if len(set(tracks)) < 2:
            raise InputError("two objects are needed to join them")
        with self._reshaping:
            (made,) = self.make([join(self.stages, [self._whole(track) for track in tracks])], tracks)
        return made

    def _whole(self, track: int) -> Amendment:
        self.require(track)
        return as_amendment(self.stages, track - 1, self.changes)

    # ----------------------------------------------------------------------------------------------------- conditions
    def _subject(self, track: int) -> Subject:
        self.require(track)
        made = self.made_by_hand().get(track)
        if made is None:
            return subject_of_track(self.stages, track - 1)
        return subject_of_amendment(self.stages, made, track)

    def _require_scan(self, index: int) -> None:
        if not 0 <= index < len(self.stages.names):
            raise InputError(f"there is no scan {index}: they are numbered from 0 to {len(self.stages.names) - 1}")
