"""A random sample while a person answers it: what the page shows of each look, and the answers it sends."""

import threading
from collections import defaultdict
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
        self._clicked: dict[int, set[int]] = defaultdict(set)
        self._lock = threading.Lock()

    def overview(self) -> dict[str, Any]:
        """Return the looks with their answers, and the result so far."""
        looks = [
            {"look": n, "kind": look.kind, "answer": self.answers.get(n, (None,))[0]}
            for n, look in enumerate(self.sample.looks)
        ]
        so_far = samples.estimate(self.sample, self.answers)
        return {"name": self._stages.frames.sequence.name, "looks": looks, **so_far}

    def look(self, n: int) -> dict[str, Any]:
        """Return what the page draws of look `n`; InputError if there is none."""
        look = self._require(n)
        with self._lock:
            if look.kind == "moment":
                self._clicked.pop(n, None)  # the page shows none of the clicks of an earlier visit
                return {"kind": look.kind, **place(self._stages, look.index, self._changes)}
            point = self._stages.points_level(look.index, look.row)
            shown = scene(self._stages, self._around(look, point), look.index)
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
        missed = len(self._clicked[n]) if answer == "done" else 0
        samples.append_answer(self._stages.folder, self.sample, n, answer, missed)
        self.answers[n] = answer, missed
        samples.note_quality(self._stages.folder)
        return samples.estimate(self.sample, self.answers)

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
        self._clicked[n].update(rest.tolist())
        return {"points": len(rest)}

    def forget(self, n: int) -> dict[str, Any]:
        """Take back what was clicked in moment `n`."""
        self._clicked.pop(n, None)
        return {"points": 0}

    def _require(self, n: int) -> samples.Look:
        if not 0 <= n < len(self.sample.looks):
            raise InputError(f"there is no look {n}: they are numbered from 0 to {len(self.sample.looks) - 1}")
        return self.sample.looks[n]

    def _around(self, look: samples.Look, point: npt.NDArray) -> Subject:
        """Return the object that a `point` (3,) is on or beside, for a while before and after."""
        stages, stamps = self._stages, self._stages.trajectory.stamps
        owner = int(stages.owner_of_points(look.index)[look.row])
        near = np.flatnonzero(np.abs(stamps - stamps[look.index]) <= AROUND)
        if owner >= 0:
            subject = subject_of_track(stages, owner)
            kept = np.isin(subject.scans, near)
            if look.index in subject.scans[kept]:
                boxes, speed = subject.boxes[kept], subject.speed[kept]
                return replace(subject, scans=subject.scans[kept], boxes=boxes, speed=speed)
        boxes = np.tile([*point, 0.5, 0.5, 0.5, 0.0], (len(near), 1))
        return Subject(0, near, boxes, np.zeros(len(near)), lambda i: np.zeros(0, np.int64))


def open_sample(stages: RunStages, changes: Changes, n_looks: int, progress: Progress) -> Looking:
    """Return the sample of a run's labels that is not answered yet, or a new one of `n_looks`; errors as of `draw`."""
    sample = samples.read_sample(stages.folder)
    if sample is not None and any(look.index >= len(stages.names) for look in sample.looks):
        raise InputError(
            f"{stages.folder / samples.SAMPLE_FILE} is of more scans than the run: remove it, and draw another"
        )
    if sample is not None and sample.labels == samples.key_of_labels(stages.folder):
        earlier = Looking(stages, sample, changes)
        if len(earlier.answers) < len(sample.looks):
            return earlier
    sample = samples.draw(stages, changes, n_looks, progress=progress)
    samples.save_sample(stages.folder, sample)
    return Looking(stages, sample, changes)
