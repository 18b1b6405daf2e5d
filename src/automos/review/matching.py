"""Finds the tracks of a run that a decision is about: those that share most points with it."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from automos.review.decisions import Cover, Decision, cover
from automos.review.run_stages import RunStages

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
    covers: dict[int, dict[str, Cover]] = {}
    for track in tracks:
        rows = stages.tracks.rows_of(track)
        scans = stages.tracks.scan[rows][stages.tracks.is_observed[rows]]
        last = max(len(scans) - 1, 0)
        moments = np.unique(np.linspace(0, last, MOMENTS).round().astype(int))[: len(scans)]
        covers[track] = {}
        for i in scans[moments].tolist():
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
    shared: dict[int, float] = defaultdict(float)
    theirs: dict[int, float] = defaultdict(float)
    ours: dict[int, float] = defaultdict(float)
    scans: dict[int, int] = defaultdict(int)
    index = {name: i for i, name in enumerate(stages.names)}
    for name, covered in decision.covers.items():
        if name not in index or not covered.rows:
            continue
        if name not in owners:
            i = index[name]
            owners[name] = np.full(len(stages.labels(i)["label"]), -1, np.int64)
            owners[name][stages.kept(i)] = stages.track_of_points(i)
        owner = owners[name]
        for track, n_points in zip(*np.unique(owner[owner >= 0], return_counts=True), strict=True):
            theirs[int(track)] += n_points  # where nothing of it was decided on, too: it may only have brushed past
        rows = [row for row in covered.rows if row < len(owner)]
        for track, hits in zip(*np.unique(owner[rows], return_counts=True), strict=True):
            if track >= 0:
                shared[int(track)] += hits / len(covered.rows) * covered.n_points
                ours[int(track)] += covered.n_points
                scans[int(track)] += 1
    return [
        track
        for track in sorted(shared)
        if shared[track] > SHARED * ours[track]
        and shared[track] > SHARED * theirs[track]
        and scans[track] >= LIFE * len(decision.covers)
    ]
