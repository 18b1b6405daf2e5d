"""Decisions of a person on the tracks of a run, as lines of the log, and the tracks of another run they are about."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, TypeAdapter

from automos.core.arrays import some_of
from automos.core.reading import checked
from automos.objects.tracks import observed
from automos.review.log import append_lines, read_lines
from automos.review.run_stages import RunStages
from automos.views.ground_map import thin_rows

CHOICES = ("moving", "static", "unknown", "undo")
"""What can be decided of a track; "undo" takes back what was decided of it before."""


MOST_POINTS = 1 << 40
"""Of a scan; what is beyond is damage."""


@dataclass(frozen=True)
class Cover:
    """The points of one scan that a decision is about: how many there were, and the rows of some of them."""

    n_points: Annotated[int, Field(ge=0, le=MOST_POINTS)]
    rows: list[Annotated[int, Field(ge=0, le=MOST_POINTS)]]


@dataclass(frozen=True)
class Decision:
    """What was decided, when, of which track of which run, and about which points.

    Attributes
    ----------
    at : str
        Time in UTC, ISO 8601.
    track : int
        Id as in tracks.json.
    verdict : str
        One of `CHOICES`.
    found : str
        The verdict of the pipeline.
    tracking : str
        Fingerprint of the tracks; another one means other tracks under the same ids.
    covers : dict of str to Cover
        By the scan's name.
    """

    at: str
    track: int
    verdict: str
    found: str
    tracking: str
    covers: dict[str, Cover]

    @property
    def sentence(self) -> str:
        """What was decided, in words."""
        scans = sorted(self.covers)
        where = f" (scans {scans[0]} to {scans[-1]})" if scans else ""
        word = {"unknown": "unsure", "undo": "as found"}.get(self.verdict, self.verdict)
        return f"The decision of {self.at} that object {self.track}{where} is {word}"


_DECISION = TypeAdapter(Decision)


def cover(rows: npt.NDArray[np.int64], most: int = 40) -> Cover:
    """Return the cover of the points in `rows`, keeping at most `most` of them, evenly."""
    return Cover(len(rows), thin_rows(rows, most).tolist())


def append_decisions(folder: Path, decisions: Iterable[Decision]) -> None:
    """Add `decisions` to the log in `folder`, on disk when this returns; errors as for the log."""
    append_lines(folder, [asdict(decision) for decision in decisions])


def read_decisions(folder: Path) -> list[Decision]:
    """Return the decisions in `folder`, oldest first; none if nobody decided anything; errors as of the log."""
    return read_lines(folder, None, "a decision", _parse)


def _parse(fields: dict[str, Any]) -> Decision:
    decision = checked(_DECISION, fields)
    if decision.verdict not in CHOICES:
        raise ValueError(decision.verdict)
    return decision


MOMENTS = 12
"""Scans of a track that a decision remembers, evenly over its life."""
SHARED = 0.5
"""Share of the decided points that a track must hold, in the scans where it holds any, and of the track's points, in
all remembered scans, that must have been decided on."""
LIFE = 0.25
"""Share of the remembered scans in which a track must be, for brushing past an object is not being it."""


def cover_tracks(stages: RunStages, tracks: Iterable[int]) -> dict[int, dict[str, Cover]]:
    """Return what each of `tracks` (indices, from 0) covers: the rows of its points in some scans, by their names."""
    wanted: dict[int, list[int]] = defaultdict(list)
    covers: dict[int, dict[str, Cover]] = {track: {} for track in tracks}
    for track in covers:
        scans = observed(stages.tracks[stages.tracks.rows_of(track)]).scan
        for i in scans[some_of(len(scans), MOMENTS)].tolist():
            wanted[i].append(track)
    for i in sorted(wanted):
        owner = stages.track_of_points(i)
        order = np.argsort(owner, kind="stable")
        starts, ends = (np.searchsorted(owner[order], wanted[i], side=side) for side in ("left", "right"))
        for track, start, end in zip(wanted[i], starts, ends, strict=True):
            if end > start:
                covers[track][stages.names[i]] = cover(stages.kept(i)[order[start:end]])
    return covers


def match(stages: RunStages, decisions: Iterable[Decision]) -> tuple[dict[int, str], list[Decision]]:
    """Return the verdict decided for each track (index, from 0), and the decisions that match no track any more.

    Decisions on tracks of this very run hold for the track of their number. Others hold for every track that shares
    more than half of its points with them; a track that was cut in two keeps the decision in both. Later decisions
    replace earlier ones, and "undo" takes them back.
    """
    decided: dict[int, str] = {}
    lost = []
    owners: dict[str, np.ndarray] = {}
    for decision in decisions:
        if decision.tracking == stages.keys["tracking"]:
            found = [decision.track - 1] if 1 <= decision.track <= len(stages.tracks) else []
        else:
            found = _holders(stages, decision, owners)
        for track in found:
            decided[track] = decision.verdict
        if not found and decision.verdict != "undo":
            lost.append(decision)
    return {track: verdict for track, verdict in decided.items() if verdict != "undo"}, lost


def ever_decided(stages: RunStages, decisions: Iterable[Decision]) -> list[int]:
    """Return the tracks (indices) that `decisions` were about at some time, those taken back since included."""
    held, _ = match(stages, (replace(one, verdict="static") if one.verdict == "undo" else one for one in decisions))
    return list(held)


def _holders(stages: RunStages, decision: Decision, owners: dict[str, np.ndarray]) -> list[int]:
    """Return the tracks that lie on the points of `decision`; `owners` keeps each scan's for the next decision."""
    n = len(stages.tracks)
    shared, theirs, ours, scans = np.zeros((4, n))
    for name, covered in decision.covers.items():
        if name not in stages.index or not covered.rows:
            continue
        if name not in owners:
            i = stages.index[name]
            owners[name] = np.full(len(stages.labels(i)["label"]), -1, np.int64)
            owners[name][stages.kept(i)] = stages.track_of_points(i)
        owner = owners[name]
        theirs += _counted(owner, n)  # where nothing of it was decided on, too: it may only have brushed past
        hits = _counted(owner[[row for row in covered.rows if row < len(owner)]], n)
        shared += hits / len(covered.rows) * covered.n_points
        ours += (hits > 0) * covered.n_points
        scans += hits > 0
    is_held = (shared > SHARED * np.maximum(ours, theirs)) & (scans >= LIFE * len(decision.covers))
    return np.flatnonzero(is_held).tolist()


def _counted(owner: npt.NDArray[np.int64], n: int) -> npt.NDArray[np.int64]:
    """Return (n,) how many of the points whose track is `owner` (K,), -1 for none, each track has."""
    return np.bincount(owner[owner >= 0], minlength=n)
