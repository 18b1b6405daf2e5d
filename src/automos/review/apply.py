"""Applies decisions to a run's labels, tracks.json and run.json.

The scans concerned are labelled again (`changes`), always from the results of the stages, never from an earlier
correction: applying everything twice, or after a crash, gives the same files.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from automos.core.geometry import Array
from automos.core.labels import Label, as_probability
from automos.core.reading import read_bytes
from automos.core.run import Progress, silent
from automos.core.scan import Sequence
from automos.core.workspace import REVIEWED, UNFINISHED, Workspace, write_run
from automos.results.point_files import write_points
from automos.results.tracks_file import box_entry, track_entries, write_tracks
from automos.review.amendments import Amendment, ever_made, in_scans, read_amendments
from automos.review.decisions import Decision, ever_decided, match, read_decisions
from automos.review.log import key_of_changes
from automos.review.run_stages import Changes, Rows, RunStages, changed_labels, number_of, replaced, scans_of

Lost = list[Decision | Amendment]
"""Changes that find no track or no scan in a run."""
RECORD = Lock()
"""Held while run.json is read and written again: decisions and answers come from several threads."""


def read_changes(stages: RunStages) -> tuple[Changes, Lost]:
    """Return the changes in the log of a run, and those that find no track or scan any more; errors as for the log."""
    decided, lost = match(stages, read_decisions(stages.folder))
    amendments, elsewhere = in_scans(read_amendments(stages.folder), stages.index)
    return Changes(decided, amendments), [*lost, *elsewhere]


def reapply(folder: Path, sequence: Sequence, progress: Progress = silent) -> dict[str, Any]:
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
            write_run(folder, run)
    return run


def is_applied(folder: Path) -> bool:
    """Return whether all of the log of `folder` is in the results; errors as for the log."""
    run = Workspace(folder).read_run()
    return UNFINISHED not in run and run.get("review", {}).get("applied") == key_of_changes(folder)


def rewrite_scan(stages: RunStages, index: int, changes: Changes) -> None:
    """Write the labels of scan `index` after all changes, as the run has them, and for exports each point's object."""
    per_point = changed_labels(stages, index, changes)
    name = stages.names[index]
    output, sure = stages.settings.output, as_probability(per_point["confidence"])
    track_ids = per_point["track"] if output.track_ids else None
    write_points(stages.folder, name, per_point["label"], track_ids, sure if output.confidence else None)
    Workspace(stages.folder).stage(REVIEWED, stages.keys["labels"]).save(name, per_point)


def rewrite_run(stages: RunStages, changes: Changes, lost: Lost) -> None:
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
        write_run(stages.folder, run)


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


def path_of(stages: RunStages, amendment: Amendment) -> tuple[Rows, Array, Array]:
    """Return where an object made by hand is: scans (K,) ascending, boxes (K, 7) and velocity (K, 3), level frame."""
    parts = sorted((stages.index[name], part) for name, part in amendment.parts.items() if name in stages.index)
    scans = np.array([i for i, _ in parts], np.int64)
    boxes = np.array([part.box_level(stages.T_level_sensor[i]) for i, part in parts]).reshape(-1, 7)
    velocity = np.zeros((len(scans), 3))
    if len(scans) > 1:
        velocity = np.gradient(boxes[:, :3], stages.trajectory.stamps[scans], axis=0)
    return scans, boxes, velocity


def amended_entry(stages: RunStages, amendment: Amendment) -> dict[str, Any]:
    """Return what tracks.json says of an object made by hand."""
    scans, boxes, velocity = path_of(stages, amendment)
    stamps = [round(stamp, 6) for stamp in stages.trajectory.stamps[scans].tolist()]
    columns = np.hstack([boxes, velocity]).round(3).tolist()
    return {
        "id": number_of(stages, amendment) + 1,
        "verdict": amendment.verdict,
        "confidence": 1.0,
        "made": amendment.how,
        "boxes": [
            box_entry(scan, stamp, True, row) for scan, stamp, row in zip(scans.tolist(), stamps, columns, strict=True)
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
