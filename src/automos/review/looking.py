"""A random sample while a person answers it: what the page shows of each look, and the answers it sends."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.run import Progress
from automos.review import sample as samples
from automos.review.proposals import Proposer
from automos.review.run_stages import Changes, RunStages
from automos.review.scenes import Subject, place, scene, subject_of_track

AROUND = 1.5
"""Seconds before and after a point that are shown with it."""


class Looking:
    """The looks of one sample, and the answers to them."""

    def __init__(self, stages: RunStages, sample: samples.Sample, changes: Changes):
        """Take a run, a sample of it, and its changes when the sample was drawn."""
        self._stages, self._changes = stages, changes
        self.sample = sample
        self.answers = samples.read_answers(stages.folder, sample)
        self._proposer = Proposer(stages)
        self._clicked: dict[int, list[npt.NDArray[np.int64]]] = {}
        self._lock = threading.Lock()

    def overview(self) -> dict[str, Any]:
        """Return the looks with their answers, and the result so far."""
        looks = [
            {"look": n, "kind": look.kind, "answer": self.answers.get(n, (None,))[0]}
            for n, look in enumerate(self.sample.looks)
        ]
        return {"name": self._stages.frames.sequence.name, "looks": looks, **self._estimate()}

    def look(self, n: int) -> dict[str, Any]:
        """Return what the page draws of look `n`; InputError if there is none."""
        look = self._require(n)
        with self._lock:
            if look.kind == "moment":
                self._clicked.pop(n, None)  # the page shows none of the clicks of an earlier visit
                return {"kind": look.kind, **place(self._stages, look.index, self._changes)}
            subject = self._around(look)
            shown = scene(self._stages, subject, look.index)
            frame = self._stages.frame(look.index)
            point = frame.points_level[np.searchsorted(frame.kept, look.row)]
            return {"kind": look.kind, **shown, "mark": (point - shown["origin"]).round(2).tolist(), "at": look.index}

    def answer(self, n: int, answer: str) -> dict[str, Any]:
        """Log the answer to look `n`: moving, static or unknown; a moment is "done"; return what all say now.

        Raises
        ------
        InputError
            No such look, or no answer to it.
        """
        look = self._require(n)
        allowed = ("done", "unknown") if look.kind == "moment" else samples.ANSWERS
        if answer not in allowed:
            raise InputError(f"{answer!r} is not an answer: say {', '.join(allowed)}")
        missed = len(np.unique(np.concatenate([[0], *self._clicked.get(n, [])]))) - 1 if answer == "done" else 0
        samples.append_answer(self._stages.folder, self.sample, n, answer, missed)
        self.answers[n] = answer, missed
        samples.note_quality(self._stages.folder)
        return self._estimate()

    def missed(self, n: int, x: float, y: float) -> dict[str, Any]:
        """Count what stands at (`x`, `y`) in moment `n` as missed; return how many points it has.

        Raises
        ------
        InputError
            No such moment, or nothing stands there.
        """
        look = self._require(n)
        if look.kind != "moment":
            raise InputError("only a moment is clicked in: say whether the marked point moves")
        with self._lock:
            rows = self._proposer.rows_at(look.index, x, y)
            is_moving, is_fringe = samples.strata(self._stages, look.index, self._changes)
            rest = rows[~(is_moving | is_fringe)[rows]]
        self._clicked.setdefault(n, []).append(rest + 1)
        return {"points": len(rest)}

    def forget(self, n: int) -> dict[str, Any]:
        """Take back what was clicked in moment `n`."""
        self._clicked.pop(n, None)
        return {"points": 0}

    def _estimate(self) -> dict[str, Any]:
        return samples.estimate(self.sample, self.answers)

    def _require(self, n: int) -> samples.Look:
        if not 0 <= n < len(self.sample.looks):
            raise InputError(f"there is no look {n}: they are numbered from 0 to {len(self.sample.looks) - 1}")
        return self.sample.looks[n]

    def _around(self, look: samples.Look) -> Subject:
        """Return the object that a point is on or beside, for a while before and after."""
        stages = self._stages
        owner = int(stages.owner_of_points(look.index)[look.row])
        point = stages.frame(look.index).points_level[np.searchsorted(stages.kept(look.index), look.row)]
        stamps = stages.trajectory.stamps
        near = np.flatnonzero(np.abs(stamps - stamps[look.index]) <= AROUND)
        if owner >= 0:
            subject = subject_of_track(stages, owner)
            kept = np.isin(subject.scans, near)
            if look.index in subject.scans[kept]:
                boxes, speed = subject.boxes[kept], subject.speed[kept]
                return replace(subject, scans=subject.scans[kept], boxes=boxes, speed=speed)
        boxes = np.tile([*point, 0.5, 0.5, 0.5, 0.0], (len(near), 1))
        nothing = np.zeros(0, np.int64)
        return Subject(0, near, boxes, np.zeros(len(near)), lambda i: nothing)


def open_sample(stages: RunStages, changes: Changes, n_looks: int, progress: Progress) -> Looking:
    """Return the sample of a run's labels that is not answered yet, or a new one of `n_looks`; errors as of `draw`."""
    sample = samples.read_sample(stages.folder)
    if sample is not None and any(look.index >= len(stages.names) for look in sample.looks):
        raise InputError(
            f"{stages.folder / samples.SAMPLE_FILE} is of more scans than the run: remove it, and draw another"
        )
    is_open = (
        sample is not None
        and sample.labels == samples.key_of_labels(stages.folder)
        and len(samples.read_answers(stages.folder, sample)) < len(sample.looks)
    )
    if sample is None or not is_open:
        sample = samples.draw(stages, changes, n_looks, progress=progress)
        samples.save_sample(stages.folder, sample)
    return Looking(stages, sample, changes)
