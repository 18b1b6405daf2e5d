"""The list of objects and places to decide on, ordered by the number of labels that a decision may correct.

The doubtful points of a track are the expected number of wrong labels: its points times the probability that its
verdict is wrong. Sorted by this number, the queue starts where a minute corrects most, and shows when to stop.
"""

from collections import defaultdict
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.objects.tracks import observed
from automos.objects.verdict import Verdict
from automos.review.amendments import Amendment
from automos.review.log import append_lines, now, read_lines
from automos.review.run_stages import Changes, RunStages, number_of, replaced, scans_of
from automos.review.scenes import Subject, subject_of_amendment, subject_of_track

ENOUGH = 0.8
"""Share of the doubtful points that the list holds: what is left is sure, one by one, and not worth a look."""


@dataclass(frozen=True, eq=False)
class Stakes:
    """What is at stake with each track, a row each.

    Attributes
    ----------
    points : (T,) float64
        How many points its segments have in all scans.
    doubt : (T,) float64
        In [0, 1], the chance that its verdict is wrong.
    """

    points: npt.NDArray[np.float64]
    doubt: npt.NDArray[np.float64]

    @property
    def doubtful(self) -> npt.NDArray[np.float64]:
        """(T,) points whose label may be expected to be wrong."""
        return self.points * self.doubt


def weigh(stages: RunStages) -> Stakes:
    """Return what is at stake with every track that a run found.

    What was seen once has no motion that could be judged, and its confidence, one half, says only that; what the
    evidence says of its points is said of it as of any track that stayed: a half of those that have moved.
    """
    tracks, n = stages.tracks, len(stages.tracks)
    counts = stages.objects.counts
    of_track, has_moved = (_counted(stages) if counts is None else counts).T
    seen = np.bincount(tracks.track, tracks.is_observed, n)
    doubt = 1.0 - stages.verdicts.confidence
    is_glimpse = (seen < 2) & (stages.verdicts.verdict != Verdict.MOVING)
    doubt = np.where(is_glimpse, 0.5 * has_moved / np.maximum(of_track, 1.0), doubt)
    return Stakes(of_track.astype(np.float64), np.clip(doubt, 0.0, 1.0))


def _counted(stages: RunStages) -> npt.NDArray[np.float64]:
    """Return (T, 2) the points of each track over its life, and those that have moved, read from every scan."""
    tracks = stages.tracks
    counts = np.zeros((len(tracks.track), 2))
    for name, rows in zip(stages.names, tracks.rows_by_scan(len(stages.names)), strict=True):
        rows = rows[tracks.is_observed[rows]]
        found = stages.stage("instances").load(name, "n_points", "n_moving")
        counts[rows] = np.stack([found[key][tracks.segment[rows]] for key in ("n_points", "n_moving")], axis=1)
    return np.stack([np.bincount(tracks.track, column, len(tracks)) for column in counts.T], axis=1)


def most_telling(doubtful: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.int64], int]:
    """Return the order of what holds most doubtful points first, and how many hold `ENOUGH` of all of them.

    doubtful : (K,) points.
    """
    order = np.argsort(-doubtful, kind="stable")
    total = doubtful.sum()
    if not total:
        return order, 0
    return order, int(np.searchsorted(np.cumsum(doubtful[order]), ENOUGH * total * (1.0 - 1e-12))) + 1


LOST_DOUBT = 0.5
"""Chance that what goes on where a moving track ends does move."""


class Queue:
    """The objects of a run and the places that its warnings point at, with what is at stake in each."""

    def __init__(self, stages: RunStages, concerns: list[dict[str, Any]]):
        """Take a run and its warnings."""
        self._stages = stages
        self._stakes = weigh(stages)
        self._rows = [self._row_of_track(k) for k in range(len(stages.tracks))]
        places = [concern for concern in concerns if "segment" in concern]
        self.places = [dict(place, place=n) for n, place in enumerate(places)]
        self._gone: dict[int, set[int]] = {}
        self._replaced: dict[int, tuple[list[str], list[int]]] = {}

    def note(self, changes: Changes) -> None:
        """Update which tracks are replaced by objects made by hand."""
        gone: dict[int, set[int]] = defaultdict(set)
        for index in scans_of(self._stages, [], changes.amendments):
            for track in self._replaced_in(index, changes):
                gone[track].add(index)
        self._gone = gone

    def _replaced_in(self, index: int, changes: Changes) -> list[int]:
        """Return what is replaced in a scan, which is found out once for the objects that are there: it reads files."""
        name = self._stages.names[index]
        keys = [one.key for one in changes.amendments if name in one.parts]
        if self._replaced.get(index, ([], []))[0] != keys:
            self._replaced[index] = keys, replaced(self._stages, index, changes)
        return self._replaced[index][1]

    def to_page(self, changes: Changes) -> dict[str, Any]:
        """Return objects and places in their order; those that hold nearly all doubtful points are its `core`.

        What an object made by hand stands for is not listed, and counts as decided on.
        """
        rows = [{**row, "decided": changes.decided.get(k)} for k, row in enumerate(self._rows)]
        dismissed = self._dismissed() if self.places else set()
        rows += [self._row_of_place(place, changes, dismissed) for place in self.places]
        order, n = most_telling(np.array([row["doubtful"] for row in rows], np.float64))
        found = [{**rows[k], "core": place < n} for place, k in enumerate(order.tolist())]
        made = [{**self._row_of_amendment(one), "core": False} for one in changes.amendments]
        return {
            "items": [*[row for row in found if "id" not in row or not self._is_gone(row["id"] - 1)], *made],
            "enough": n,
            "doubtful": float(sum(row["doubtful"] for row in rows)),
        }

    # ------------------------------------------------------------------------------------------------------ the rows
    def _row_of_track(self, track: int) -> dict[str, Any]:
        return {
            "id": track + 1,
            "verdict": self._stages.verdict(track),
            "confidence": round(float(self._stages.verdicts.confidence[track]), 3),
            "points": round(float(self._stakes.points[track])),
            "doubtful": round(float(self._stakes.doubtful[track]), 1),
            **_path_of(subject_of_track(self._stages, track)),
        }

    def _row_of_amendment(self, amendment: Amendment) -> dict[str, Any]:
        number = number_of(self._stages, amendment) + 1
        return {
            "id": number,
            "made": amendment.how,
            "verdict": amendment.verdict,
            "decided": amendment.verdict,
            "confidence": 1.0,
            "points": sum(len(part.rows) for part in amendment.parts.values()),
            "doubtful": 0.0,
            **_path_of(subject_of_amendment(self._stages, amendment, number)),
        }

    def _row_of_place(self, place: dict[str, Any], changes: Changes, dismissed: set[tuple[str, int]]) -> dict[str, Any]:
        shown = {key: place[key] for key in ("place", "sentence", "track", "scan", "at", "points")}
        own, scan = set(self._points_of(place)), place["scan"]
        mended = [one.parts[scan].rows.tolist() for one in changes.amendments if scan in one.parts]
        is_done = any((scan, row) in dismissed for row in own) or not own.isdisjoint(chain(*mended))
        return {
            **shown,
            "index": self._stages.index[scan],
            "doubtful": round(LOST_DOUBT * place["points"], 1),
            "decided": "done" if is_done else None,
        }

    def _is_gone(self, track: int) -> bool:
        if track not in self._gone:
            return False
        seen = observed(self._stages.tracks[self._stages.tracks.rows_of(track)])
        return set(seen.scan.tolist()) <= self._gone[track]

    # -------------------------------------------------------------------------------------------------------- places
    def place(self, number: int) -> dict[str, Any]:
        """Return the place with this number; InputError if there is none."""
        if not 0 <= number < len(self.places):
            raise InputError(f"there is no place {number}")
        return self.places[number]

    def dismiss(self, number: int) -> None:
        """Log that nothing was missed at a place, by one of its points, which other runs have, too."""
        place = self.place(number)
        row = self._points_of(place)[0]
        append_lines(self._stages.folder, [{"kind": "dismissed", "at": now(), "scan": place["scan"], "row": row}])

    def _dismissed(self) -> set[tuple[str, int]]:
        """Return the points at which nothing was missed: scan and row; the log is read once for all places."""
        found = read_lines(self._stages.folder, "dismissed", "a place", lambda at: (str(at["scan"]), int(at["row"])))
        return set(found)

    def _points_of(self, place: dict[str, Any]) -> list[int]:
        if "rows" not in place:
            index = self._stages.index[place["scan"]]
            own = np.equal(self._stages.segments(index), place["segment"]).any(axis=0)
            place["rows"] = self._stages.kept(index)[own].tolist()
        rows: list[int] = place["rows"]
        return rows


def _path_of(subject: Subject) -> dict[str, Any]:
    """Return what the list says of where something was seen."""
    boxes = subject.boxes
    return {
        "seen": len(subject.scans),
        "first": int(subject.scans[0]),
        "last": int(subject.scans[-1]),
        "moved": round(float(np.hypot(*(boxes[-1] - boxes[0])[:2])), 1),
        "size": boxes[:, 3:6].max(axis=0).round(1).tolist(),
    }
