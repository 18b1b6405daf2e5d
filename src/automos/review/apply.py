"""Applies decisions to a run's labels, tracks.json and run.json.

A decision replaces the verdict of a track, and the scans concerned are labelled again by the `labels` stage: the result
is what the pipeline would have written with this verdict. An object made by a person takes its points from any other
object. The inputs are always the results of the stages, never an earlier correction, so applying everything twice, or
after a crash, gives the same files.
"""

import json
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_text
from automos.core.labels import Label, as_probability
from automos.core.reading import read_bytes
from automos.core.scan import Sequence
from automos.core.workspace import REVIEWED, RUN_FILE, UNFINISHED, Workspace
from automos.objects.labels import label_scans
from automos.objects.verdict import Verdict, Verdicts
from automos.results.point_files import write_points
from automos.results.tracks_file import box_entry, track_entries, write_tracks
from automos.review.amendments import Amendment, ever_made, in_scans, read_amendments
from automos.review.decisions import Decision, read_decisions
from automos.review.log import key_of_changes
from automos.review.matching import ever_decided, match
from automos.review.run_stages import RunStages

_VERDICT = {"moving": Verdict.MOVING, "static": Verdict.STATIC, "unknown": Verdict.UNKNOWN}
_LABEL = {"moving": Label.MOVING, "static": Label.STATIC, "unknown": Label.UNLABELED}
RECORD = Lock()
"""Held while run.json is read and written again: decisions and answers come from several threads."""
TAKEN = 0.5
"""Share of a track's points in a scan from which an object made by hand replaces it there."""
DOUBTFUL, CERTAIN = 128, 255
"""Confidences, of 255."""


@dataclass(frozen=True)
class Changes:
    """The changes to a run by a person: verdicts by track (index, from 0), and objects made by hand."""

    decided: dict[int, str] = field(default_factory=dict)
    amendments: list[Amendment] = field(default_factory=list)


def read_changes(stages: RunStages) -> tuple[Changes, list[Decision | Amendment]]:
    """Return the changes in the log of a run, and those that find no track or scan any more; errors as for the log."""
    decided, lost = match(stages, read_decisions(stages.folder))
    amendments, elsewhere = in_scans(read_amendments(stages.folder), stages.index)
    return Changes(decided, amendments), [*lost, *elsewhere]


def reapply(
    folder: Path, sequence: Sequence, progress: Callable[[str, int, int], None] = lambda name, done, total: None
) -> dict[str, Any]:
    """Apply the log of `folder` to the results there; return the new run.json.

    Raises
    ------
    InputError
        A damaged log, or results without stages.
    """
    decisions, made = read_decisions(folder), ever_made(folder)
    if not decisions and not made:
        return Workspace(folder).read_run()
    stages = RunStages(folder, sequence)
    changes, lost = read_changes(stages)
    # What was taken back may still be in the labels, if the session ended before it was written.
    scans = scans_of(stages, ever_decided(stages, decisions), made)
    for done, i in enumerate(scans, start=1):
        rewrite_scan(stages, i, changes)
        progress("decisions", done, len(scans))
    rewrite_run(stages, changes, lost)
    return note_applied(folder)


def note_applied(folder: Path) -> dict[str, Any]:
    """Have run.json say that all of the log of `folder` is in the results; return what it says."""
    with RECORD:
        run, key = Workspace(folder).read_run(), key_of_changes(folder)
        if key:
            run["review"] = {**run.get("review", {}), "applied": key}
            write_text(folder / RUN_FILE, json.dumps(run, indent=1))
    return run


def is_applied(folder: Path) -> bool:
    """Return whether all of the log of `folder` is in the results; errors as for the log."""
    run = Workspace(folder).read_run()
    return UNFINISHED not in run and run.get("review", {}).get("applied") == key_of_changes(folder)


def scans_of(stages: RunStages, tracks: Iterable[int], amendments: Iterable[Amendment] = ()) -> list[int]:
    """Return the scans that `tracks` (indices, from 0) or `amendments` are in."""
    of_tracks = stages.tracks.scan[np.isin(stages.tracks.track, list(tracks))].tolist()
    of_amendments = [stages.index[name] for one in amendments for name in one.parts if name in stages.index]
    return sorted({*of_tracks, *of_amendments})


def rewrite_scan(stages: RunStages, index: int, changes: Changes) -> None:
    """Write the labels of scan `index` after all changes, as the run has them, and for exports each point's object."""
    per_point = changed_labels(stages, index, changes)
    name = stages.names[index]
    output, sure = stages.settings.output, as_probability(per_point["confidence"])
    track_ids = per_point["track"] if output.track_ids else None
    write_points(stages.folder, name, per_point["label"], track_ids, sure if output.confidence else None)
    Workspace(stages.folder).stage(REVIEWED, stages.keys["labels"]).save(name, per_point)


def changed_labels(stages: RunStages, index: int, changes: Changes) -> dict[str, npt.NDArray]:
    """Return label, track and confidence (N,) of scan `index` after `changes`."""
    per_point = decided_labels(stages, index, changes.decided)
    here = list(parts_in(stages, index, changes))
    if not here:
        return per_point
    label, track, confidence = (per_point[key].copy() for key in ("label", "track", "confidence"))
    freed = np.isin(track, replaced(stages, index, changes))
    label[freed], track[freed], confidence[freed] = Label.STATIC, -1, DOUBTFUL
    for amendment, rows in here:
        label[rows], confidence[rows] = _LABEL[amendment.verdict], CERTAIN
        track[rows] = number_of(stages, amendment) if amendment.verdict == "moving" else -1
    return {"label": label, "track": track, "confidence": confidence}


def decided_labels(stages: RunStages, index: int, decided: dict[int, str]) -> dict[str, npt.NDArray]:
    """Return label, track and confidence (N,) of scan `index` after `decided` (verdict by track index, from 0).

    Points of a track that is unsure are unlabeled: neither moving nor static may be learnt from them.
    """
    here = stages.tracks.track[stages.tracks.scan == index].tolist()
    if all(decided.get(track, "static") == "static" == stages.verdict(track) or track not in decided for track in here):
        return stages.labels(index)  # a static track that a person calls static paints nothing either way
    verdicts = decided_verdicts(stages.verdicts, decided)
    unsure = np.array([track for track, verdict in decided.items() if verdict == "unknown"], np.int64)
    verdicts.verdict[unsure] = Verdict.MOVING  # painted as if it moved, to learn which points it has
    objects = replace(stages.objects, verdicts=verdicts)
    painted = label_scans(stages.scans, objects, stages.settings, 1, [index])
    per_point = dict(next(iter(painted))[1])
    is_unsure = np.isin(per_point["track"], unsure)
    per_point["label"] = np.where(is_unsure, np.uint8(Label.UNLABELED), per_point["label"])
    per_point["track"] = np.where(is_unsure, np.int32(-1), per_point["track"])
    return per_point


def replaced(stages: RunStages, index: int, changes: Changes) -> list[int]:
    """Return the tracks (indices) that objects made by hand replace in scan `index`: they hold most of their points."""
    rows = [rows for _, rows in parts_in(stages, index, changes)]
    if not rows:
        return []
    owner = stages.owner_of_points(index)
    of_all = np.bincount(owner[owner >= 0], minlength=len(stages.tracks))
    taken = owner[np.unique(np.concatenate(rows))]
    held = np.bincount(taken[taken >= 0], minlength=len(stages.tracks))
    return np.flatnonzero((held > TAKEN * of_all) & (of_all > 0)).tolist()


def number_of(stages: RunStages, amendment: Amendment) -> int:
    """Return the index of an object made by hand among the tracks: after all that were found."""
    return len(stages.tracks) + int(amendment.key[1:]) - 1


def parts_in(stages: RunStages, index: int, changes: Changes) -> Iterator[tuple[Amendment, npt.NDArray[np.int64]]]:
    """Yield the objects made by hand that are in scan `index`, each with its rows there."""
    name = stages.names[index]
    for amendment in changes.amendments:
        if name in amendment.parts:
            rows = amendment.parts[name].rows
            yield amendment, rows[rows < len(stages.labels(index)["label"])]


def decided_verdicts(found: Verdicts, decided: dict[int, str]) -> Verdicts:
    """Return the verdicts after `decided`; what a person decided is certain."""
    verdict, confidence = found.verdict.copy(), found.confidence.copy()
    for track, word in decided.items():
        verdict[track], confidence[track] = _VERDICT[word], 1.0
    return replace(found, verdict=verdict, confidence=confidence)


# ------------------------------------------------------------------------------------------- tracks.json and run.json
def rewrite_run(stages: RunStages, changes: Changes, lost: list[Decision | Amendment]) -> None:
    """Write tracks.json and run.json after all changes."""
    counted: Counter[str] = Counter()

    def entries() -> Iterator[dict[str, Any]]:  # one after another: those of a long recording take much memory
        for entry in changed_entries(stages, changes):
            counted[entry["verdict"]] += 1
            yield entry

    write_tracks(stages.folder / "tracks.json", stages.trajectory, stages.names, entries())
    points = _count_points(stages)
    review = {
        "decisions": len(changes.decided),
        "made": len(changes.amendments),
        "lost": [
            f"{one.sentence} finds no such {'object' if isinstance(one, Decision) else 'scan'} in this run; it stays "
            "in the log and holds when one is there."
            for one in lost
        ],
    }
    with RECORD:
        run = Workspace(stages.folder).read_run()
        run["points"] = points
        run["tracks"] = {**run.get("tracks", {}), "total": counted.total(), "moving": counted["moving"]}
        run["review"] = review
        write_text(stages.folder / RUN_FILE, json.dumps(run, indent=1))


def changed_entries(stages: RunStages, changes: Changes) -> Iterator[dict[str, Any]]:
    """Yield the entries of tracks.json after `changes`: tracks that are not replaced, then objects made by hand."""
    gone: dict[int, set[int]] = defaultdict(set)  # scans by track
    for index in scans_of(stages, [], changes.amendments):
        for track in replaced(stages, index, changes):
            gone[track].add(index)
    found = track_entries(stages.tracks, stages.verdicts, stages.trajectory)
    for k, entry in enumerate(found):
        entry["boxes"] = [box for box in entry["boxes"] if box["scan"] not in gone[k]]
        if k in gone and not any(box["observed"] for box in entry["boxes"]):
            continue
        if k in changes.decided:
            before = {"verdict": entry["verdict"], "confidence": entry["confidence"]}
            boxes = entry.pop("boxes")
            entry.update(verdict=changes.decided[k], confidence=1.0, boxes=boxes, found=before)
        yield entry
    for amendment in changes.amendments:
        yield amended_entry(stages, amendment)


def amended_entry(stages: RunStages, amendment: Amendment) -> dict[str, Any]:
    """Return what tracks.json says of an object made by hand."""
    scans = np.array(sorted(stages.index[name] for name in amendment.parts if name in stages.index), np.int64)
    T_level_sensor, stamps = stages.trajectory.T_level_sensor, stages.trajectory.stamps
    boxes = np.array([amendment.parts[stages.names[i]].box_level(T_level_sensor[i]) for i in scans]).reshape(-1, 7)
    velocity = np.gradient(boxes[:, :3], stamps[scans], axis=0) if len(scans) > 1 else np.zeros((len(scans), 3))
    return {
        "id": number_of(stages, amendment) + 1,
        "verdict": amendment.verdict,
        "confidence": 1.0,
        "made": amendment.how,
        "boxes": [
            box_entry(int(i), round(float(stamps[i]), 6), True, columns)
            for i, columns in zip(scans, np.column_stack([boxes, velocity]).round(3).tolist(), strict=True)
        ],
    }


def _count_points(stages: RunStages) -> dict[str, int]:
    counts = np.zeros(len(Label), np.int64)
    for name in stages.names:
        path = stages.folder / "predictions" / f"{name}.label"
        counts += _counts_of(path, path.stat().st_mtime_ns)
    return {label.name.lower(): int(n) for label, n in zip(Label, counts, strict=True)}


@lru_cache(1_000_000)  # more than a day of scans: of one too few, all are read again for each decision
def _counts_of(path: Path, written: int) -> tuple[int, ...]:
    """Return the points of each label in a file, which is read again only when it was written again."""
    labels = np.frombuffer(read_bytes(path), np.uint32) & 0xFFFF
    return tuple(int((labels == label).sum()) for label in Label)
