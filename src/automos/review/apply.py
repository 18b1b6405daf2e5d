"""A run's labels, tracks.json and run.json as a person's decisions make them.

A decision replaces a track's verdict, and the scans it concerns are painted again by the stage that painted them first:
what comes out is what the pipeline would have written, had it judged so. Everything starts from what the stages found,
never from an earlier rewriting, so applying decisions twice, or after a crash, gives the same files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.atomic import atomic_path, write_text
from automos.labels import Label, pack
from automos.review.decisions import Decision, read_decisions
from automos.review.matching import match
from automos.review.run_stages import RunStages
from automos.scan import Sequence
from automos.stages import paint
from automos.tracking.verdict import Verdict, Verdicts
from automos.workspace import RUN_FILE, Workspace

_VERDICT = {"moving": Verdict.MOVING, "static": Verdict.STATIC, "unknown": Verdict.UNKNOWN}


def reapply(
    folder: Path, sequence: Sequence, progress: Callable[[str, int, int], None] = lambda name, done, total: None
) -> dict[str, Any]:
    """Apply the decisions in the log of `folder` to the results there; return what run.json says then.

    Raises
    ------
    InputError
        A damaged log, or results without stages.
    """
    decisions = read_decisions(folder)
    if not decisions:
        return Workspace(folder).read_run()
    stages = RunStages(folder, sequence)
    decided, lost = match(stages, decisions)
    scans = scans_of(stages, decided)
    for done, i in enumerate(scans, start=1):
        rewrite_scan(stages, i, decided)
        progress("decisions", done, len(scans))
    return rewrite_run(stages, decided, lost)


def scans_of(stages: RunStages, tracks: Iterable[int]) -> list[int]:
    """Return the scans that `tracks` (indices, from 0) are in."""
    return np.unique(stages.tracks.scan[np.isin(stages.tracks.track, list(tracks))]).tolist()


def rewrite_scan(stages: RunStages, index: int, decided: dict[int, str]) -> None:
    """Write the label file of scan `index`, and its confidences where the run has them, after all decisions."""
    per_point = decided_labels(stages, index, decided)
    name = stages.names[index]
    ids = per_point["track"] + 1 if stages.settings.output.track_ids else None
    with atomic_path(stages.folder / "predictions" / f"{name}.label") as temporary:
        pack(per_point["label"], ids).tofile(temporary)
    if stages.settings.output.confidence:
        confidence = per_point["confidence"].astype(np.float32) / np.float32(255.0)
        with atomic_path(stages.folder / "confidences" / f"{name}.npy") as temporary, temporary.open("wb") as file:
            np.save(file, confidence)


def decided_labels(stages: RunStages, index: int, decided: dict[int, str]) -> dict[str, npt.NDArray]:
    """Return label, track and confidence (N,) of scan `index` after `decided` (verdict by track index, from 0).

    Points of a track that is unsure are unlabeled: neither moving nor static may be learnt from them.
    """
    here = stages.tracks.track[stages.tracks.scan == index]
    if not set(decided) & set(here.tolist()):
        return stages.labels(index)
    verdicts = decided_verdicts(stages.verdicts, decided)
    unsure = np.array([track for track, verdict in decided.items() if verdict == "unknown"], np.int64)
    verdicts.verdict[unsure] = Verdict.MOVING  # painted as if it moved, to learn which points it has
    found = stages.stage("candidates"), stages.stage("instances")
    painted = paint(stages.frames, *found, stages.names, stages.tracks, verdicts, stages.settings, 1, [index])
    per_point = dict(next(iter(painted))[1])
    is_unsure = np.isin(per_point["track"], unsure)
    per_point["label"] = np.where(is_unsure, np.uint8(Label.UNLABELED), per_point["label"])
    per_point["track"] = np.where(is_unsure, np.int32(-1), per_point["track"])
    return per_point


def decided_verdicts(found: Verdicts, decided: dict[int, str]) -> Verdicts:
    """Return the verdicts after `decided`; what a person decided is certain."""
    verdict, confidence = found.verdict.copy(), found.confidence.copy()
    for track, word in decided.items():
        verdict[track], confidence[track] = _VERDICT[word], 1.0
    return Verdicts(verdict, confidence)


def rewrite_run(stages: RunStages, decided: dict[int, str], lost: list[Decision]) -> dict[str, Any]:
    """Write tracks.json and run.json after all decisions; return what run.json says."""
    path = stages.folder / "tracks.json"
    tracks_file = json.loads(path.read_text())
    verdicts = decided_verdicts(stages.verdicts, decided)
    for track in tracks_file["tracks"]:
        k = track["id"] - 1
        before = Verdict(stages.verdicts.verdict[k]).name.lower(), round(float(stages.verdicts.confidence[k]), 3)
        track.pop("found", None)
        track["verdict"] = Verdict(verdicts.verdict[k]).name.lower()
        track["confidence"] = round(float(verdicts.confidence[k]), 3)
        if k in decided:
            track["found"] = {"verdict": before[0], "confidence": before[1]}
    lines = ",\n  ".join(json.dumps(track) for track in tracks_file.pop("tracks"))
    write_text(path, json.dumps(tracks_file, indent=1)[:-2] + f',\n "tracks": [\n  {lines}\n ]\n}}\n')

    run = Workspace(stages.folder).read_run()
    run["points"] = _count_points(stages)
    run["tracks"] = {**run["tracks"], "moving": int((verdicts.verdict == Verdict.MOVING).sum())}
    run["review"] = {
        "decisions": len(decided),
        "lost": [
            f"{decision.sentence} finds no such object in this run; it stays in the log and holds when one is there."
            for decision in lost
        ],
    }
    write_text(stages.folder / RUN_FILE, json.dumps(run, indent=1))
    return run


def _count_points(stages: RunStages) -> dict[str, int]:
    counts = dict.fromkeys((label.name.lower() for label in Label), 0)
    for name in stages.names:
        labels = np.fromfile(stages.folder / "predictions" / f"{name}.label", np.uint32) & 0xFFFF
        for label in Label:
            counts[label.name.lower()] += int((labels == label).sum())
    return counts
