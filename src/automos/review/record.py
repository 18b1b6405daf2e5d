"""All decisions and objects of a review; each is logged at once, completely, and one at a time."""

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from automos.core.errors import InputError
from automos.results.run_files import RunFiles
from automos.review.ahead import Waiting
from automos.review.amendments import Amendment, append_amendments, append_verdicts, new_keys
from automos.review.apply import note_applied, read_changes
from automos.review.concerns import note_concerns
from automos.review.decisions import CHOICES, Decision, append_decisions, cover_tracks
from automos.review.log import now
from automos.review.queue import Queue
from automos.review.run_stages import RunStages, number_of, scans_of
from automos.review.writer import Gain, Writer


class Record:
    """The changes of one review, the queue that they are worked off from, and the thread that writes the results."""

    def __init__(self, run: RunFiles, stages: RunStages, waiting: Waiting):
        """Read the earlier decisions; InputError if the log is damaged."""
        self.run, self.stages = run, stages
        self.changes, lost = read_changes(stages)
        self.queue = Queue(stages, note_concerns(stages, False))
        self.queue.note(self.changes)
        self.gain = Gain(RunStages(run.folder, run.sequence), waiting)
        self.writer = Writer(run, lost, lambda: self.changes, self.gain, waiting)
        self._covering = RunStages(run.folder, run.sequence)  # of its own, so that deciding never waits for looking
        self._has_ended = False
        self._gate = threading.Lock()  # a decision is taken whole, or waits until another or finishing is through

    def decide(self, tracks: Iterable[int], verdict: str) -> None:
        """Log the decision that the objects with ids `tracks` are `verdict`, and have it written into the results.

        verdict : one of `CHOICES`.

        Raises
        ------
        InputError
            There is no such object or verdict, the log cannot be written, or the review has ended.
        """
        tracks = list(tracks)
        made = self.made_by_hand()
        for track in tracks:
            self.require(track)
        if verdict not in CHOICES:
            raise InputError(f"{verdict!r} is not a verdict: decide on {', '.join(CHOICES)}")
        with self._gated(", ".join(f"object {track}" for track in tracks)):
            found = [track - 1 for track in tracks if track not in made]
            self._log_decisions(found, verdict)
            by_hand = [made[track] for track in tracks if track in made]
            if by_hand:
                append_verdicts(self.run.folder, now(), {one.key: verdict for one in by_hand})
                self._reread()
            self.writer.add(scans_of(self.stages, found, by_hand))

    def _log_decisions(self, found: list[int], verdict: str) -> None:
        covers = cover_tracks(self._covering, found)
        at, key = now(), self.stages.keys["tracking"]
        append_decisions(
            self.run.folder,
            [Decision(at, track + 1, verdict, self.stages.verdict(track), key, covers[track]) for track in found],
        )
        decided = self.changes.decided | dict.fromkeys(found, verdict)
        held = {track: word for track, word in decided.items() if word != "undo"}
        self.changes = replace(self.changes, decided=held)

    def dismiss(self, number: int) -> None:
        """Log that nothing was missed at the place with this number; InputError if there is none."""
        with self._gated(f"place {number}"):
            self.queue.dismiss(number)

    def make(self, amendments: list[Amendment], instead_of: Iterable[int] = ()) -> list[int]:
        """Log `amendments`, which stand for the objects `instead_of`; return their ids; errors as of `decide`."""
        with self._gated("what was made by hand"):
            keys = new_keys(self.run.folder, len(amendments))
            keyed = [replace(one, key=key) for one, key in zip(amendments, keys, strict=True)]
            made = self.made_by_hand()
            gone = [made[number] for number in set(instead_of) & made.keys()]
            append_amendments(self.run.folder, keyed)
            append_verdicts(self.run.folder, now(), {one.key: "undo" for one in gone})
            self._reread()
            self.writer.add(scans_of(self.stages, [], [*keyed, *gone]))
            return [self.number(one) for one in keyed]

    def _reread(self) -> None:
        self.changes, _ = read_changes(self._covering)
        self.queue.note(self.changes)

    def finish(self) -> None:
        """Wait until everything is in the results, then write the report; the review goes on.

        Raises
        ------
        InputError
            Something could not be written. It is tried again when finishing next.
        """
        with self._gate:  # nothing is decided meanwhile: what is in the log is in the results
            self.writer.finish()
            note_applied(self.run.folder)

    def number(self, amendment: Amendment) -> int:
        """Return the id of an object made by hand."""
        return number_of(self.stages, amendment) + 1

    def made_by_hand(self) -> dict[int, Amendment]:
        """Return the objects made by hand by their ids."""
        return {self.number(one): one for one in self.changes.amendments}

    def require(self, track: int) -> None:
        """Raise InputError unless an object, found or made by hand, has the id `track`."""
        n_found = len(self.stages.tracks)
        if not 1 <= track <= n_found and track not in self.made_by_hand():
            raise InputError(f"there is no object {track}: they are numbered from 1 to {n_found}")

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
