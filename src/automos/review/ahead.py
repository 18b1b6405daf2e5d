"""What a review makes in the background: proposals ahead of time, none older than the last decision, and pictures.

What a person waits for comes first: what goes on beside it gives way.
"""

import logging
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from automos.core.errors import AutomosError, InputError
from automos.core.geometry import transform
from automos.results.run_files import RunFiles
from automos.results.tracks_file import track_entries
from automos.review.amendments import Amendment
from automos.review.apply import amended_entry
from automos.review.proposals import Proposer
from automos.review.queue import Queue
from automos.review.reshaping import OnScan, Way, proposed
from automos.review.run_stages import Changes, RunStages, number_of
from automos.review.scenes import scene, subject_of_amendment
from automos.views.ground_map import Thumbnails


class Waiting:
    """Entered while somebody waits for an answer, in which nothing that gives way is waited for."""

    def __init__(self) -> None:
        self._n, self._news = 0, threading.Condition()

    def __enter__(self) -> None:
        self._add(1)

    def __exit__(self, *error: object) -> None:
        self._add(-1)

    def _add(self, n: int) -> None:
        with self._news:
            self._n += n
            self._news.notify_all()

    def give_way(self, unless: Callable[[], bool] = lambda: False) -> None:
        """Return once nobody waits any more, or `unless` is true."""
        with self._news:
            self._news.wait_for(lambda: not self._n or unless())


MOST = 400
"""Objects that get a picture, those first in the queue; who goes on that far sees the others when they are open."""
IN_SIGHT = 12
"""Rows of the list on a usual screen: for their pictures nobody waits until a long recording was read through."""


class Pictures:
    """Thumbnails by object id: of what was found once its scans were gone through, of what is made by hand at once."""

    def __init__(self, run: RunFiles, stages: RunStages, queue: Queue, waiting: Waiting):
        """Begin to make them."""
        self._run, self._stages, self._queue, self._waiting = run, stages, queue, waiting
        self._found: dict[int, dict[str, Any]] = {}
        self._made: dict[int, dict[str, Any]] = {}
        self._is_whole = self._is_stopped = False
        threading.Thread(target=self._make, daemon=True).start()

    def to_page(self, amendments: Iterable[Amendment]) -> dict[str, Any]:
        """Return the pictures by object id, those of objects made by hand too, and whether that is all."""
        for amendment in amendments:
            if number_of(self._stages, amendment) + 1 not in self._made:
                thumbnails = Thumbnails([amended_entry(self._stages, amendment)])
                for index in thumbnails.scans:
                    thumbnails.add(index, self._stages.frame(index).points_level)
                self._made |= thumbnails.to_page()
        return {"ready": self._is_whole, "pictures": self._found | self._made}

    def stop(self) -> None:
        """Make no more."""
        self._is_stopped = True

    def _make(self) -> None:
        with suppress(AutomosError):  # a list without pictures is a list
            wanted = [item["id"] for item in self._queue.to_page(Changes())["items"] if "id" in item][:MOST]
            for ids in (wanted[:IN_SIGHT], wanted[IN_SIGHT:]):
                found = self._stages.tracks, self._stages.verdicts, self._stages.trajectory
                self._add(list(track_entries(*found, [track - 1 for track in ids])))
        self._is_whole = True

    def _add(self, entries: list[dict[str, Any]]) -> None:
        thumbnails = Thumbnails(entries)
        for index in sorted(thumbnails.scans):
            self._waiting.give_way()
            if self._is_stopped:
                return
            scan = self._run.scan(index)
            points = transform(self._run.T_level_sensor(index), self._run.points_at_pose(scan, index))
            thumbnails.add(index, points[scan.is_valid])
        self._found = self._found | thumbnails.to_page()


_log = logging.getLogger(__name__)

What = tuple[Any, ...]
"""What a person points at: a method of `Proposer` and its arguments."""
Shown = tuple[Amendment, dict[str, Any]]
"""What is proposed, and its scene."""
KEPT = 8
"""Proposals kept, a megabyte or two each: those made ahead, and some to come back to."""
GLANCE = 0.1
"""Seconds between looks whether somebody still waits for what another thread makes."""


class GivenUpError(InputError):
    """Nobody waits for a proposal any more."""

    def __init__(self) -> None:
        super().__init__("it is no longer followed: it was given up, or something else was asked for")


class _Proposal:
    """What is found of one thing so far; whoever holds its lock goes on with it."""

    def __init__(self, stages: RunStages, find: Callable[[OnScan], Way]):
        self.lock, self.sought, self.total = threading.Lock(), 0, 0
        self._stages, self._find = stages, find
        self._way: Way | None = None
        self.shown: Shown | None = None
        self._may_go_on: Callable[[], bool] = lambda: True

    def _on_scan(self, total: int) -> None:
        if not self._may_go_on():
            raise GivenUpError
        self.sought, self.total = self.sought + (total > 0), total

    def made(self, changes: Callable[[], Changes], may_go_on: Callable[[], bool]) -> Shown:
        """Return the object and its scene, after the changes as they are when it is returned."""
        self._may_go_on = may_go_on
        if self._way is None:
            self._way = self._find(self._on_scan)
        after = None
        while after is not (after := changes()):
            found = proposed(self._stages, self._way, after)
            if self.shown is None or not _is_same(found, self.shown[0]):
                self.shown = found, scene(self._stages, subject_of_amendment(self._stages, found, 0))
        assert self.shown is not None
        return self.shown


def _is_same(one: Amendment, other: Amendment) -> bool:
    """Return whether two proposals of one way have the same points."""
    return one.parts.keys() == other.parts.keys() and all(
        np.array_equal(part.rows, other.parts[name].rows) for name, part in one.parts.items()
    )


class Proposals:
    """The proposals of one review: at most one is waited for, and while none is, others are made ahead."""

    def __init__(self, stages: RunStages, changes: Callable[[], Changes], waiting: Waiting):
        """Take the run's stages, what gives all changes as they are now, and what tells that somebody waits."""
        self._stages, self._changes, self._waiting = stages, changes, waiting
        self._proposer = Proposer(stages)
        self._kept: dict[What, _Proposal] = {}
        self._ahead: list[What] = []
        self.asked: What | None = None
        """What was asked for last, unless it was cancelled."""
        self._turn, self._is_stopped = 0, False
        self._news = threading.Condition()
        threading.Thread(target=self._work, daemon=True).start()

    def get(self, what: What) -> Shown:
        """Return what is there as an object, and its scene; whatever was asked for before is given up.

        Raises
        ------
        InputError
            Nothing is there.
        GivenUpError
            Something else was asked for meanwhile, or it was cancelled.
        """
        with self._news:
            if what != self.asked:
                self.asked, self._turn = what, self._turn + 1
            turn, one = self._turn, self._proposal(what)
        with self._waiting:
            while not one.lock.acquire(timeout=GLANCE):
                if self._turn != turn:
                    raise GivenUpError
            try:
                return one.made(self._changes, lambda: self._turn == turn)
            finally:
                one.lock.release()

    def make_ahead(self, wanted: Iterable[What]) -> None:
        """Make these while nothing is waited for, and no others."""
        with self._news:
            self._ahead = list(wanted)
            self._news.notify_all()

    def cancel(self) -> None:
        """Give up what is waited for, and forget what was proposed last."""
        with self._news:
            self.asked, self._turn = None, self._turn + 1

    def stop(self) -> None:
        """Make no more."""
        self._is_stopped = True
        self.cancel()
        self.make_ahead([])

    def is_made(self, what: What) -> bool:
        """Return whether it was followed to its ends."""
        return what in self._kept and self._kept[what].shown is not None

    def progress(self) -> dict[str, int]:
        """Return how many scans of what is waited for were gone through, and of how many, 0 if that is not known."""
        one = self._kept.get(self.asked or ())
        return {"scans": one.sought if one else 0, "of": one.total if one else 0}

    def _proposal(self, what: What) -> _Proposal:
        method, *where = what
        one = self._kept.pop(what, None) or _Proposal(self._stages, partial(method, self._proposer, *where))
        self._kept[what] = one
        if len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return one

    def _work(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._is_stopped or self._ahead)
                if self._is_stopped:
                    return
                what = self._ahead[0]
                one = self._proposal(what)
            try:
                with one.lock:
                    one.made(self._changes, partial(self._is_wanted, what))
            except GivenUpError:
                continue
            except Exception as error:  # whoever asks for it hears of it
                _log.debug("%s cannot be made ahead", what, exc_info=not isinstance(error, AutomosError))
            with self._news:
                self._ahead = [other for other in self._ahead if other != what]

    def _is_wanted(self, what: What) -> bool:
        self._waiting.give_way(unless=lambda: self.asked == what or what not in self._ahead)
        return self.asked == what or what in self._ahead
