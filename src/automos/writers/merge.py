"""Merges corrections made in another tool into a run's results: new labels and tracks, and a count of changes."""

import os
import shutil
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Ints
from automos.core.atomic import held, remove_parts, write_json, write_raw
from automos.core.claims import remove
from automos.core.errors import InputError
from automos.core.label_files import pack, read_labels, to_mos
from automos.core.labels import Label
from automos.core.reading import is_there
from automos.core.workspace import COMPLETE, RUN_FILE, Workspace, write_run
from automos.results.claiming import per_scan_files, require_room
from automos.results.point_files import count_points, no_points
from automos.results.run_files import RunFiles
from automos.results.tracks_file import VERDICTS
from automos.writers.edits import EditedScan, read_edits, require_known
from automos.writers.formats import copy_file
from automos.writers.relabel import compare, relabel


@dataclass
class Merged:
    """What a merge changed.

    Attributes
    ----------
    boxes : boxes by what was done to them: unchanged, moved, verdict (given another), added, removed; a box may be
        moved and be given another verdict.
    points : points by change of label, as "static to moving".
    scans : how many scans have another label than before.
    """

    boxes: Counter[str] = field(default_factory=Counter)
    points: Counter[str] = field(default_factory=Counter)
    scans: int = 0

    def summary(self) -> str:
        """Return what changed in a line."""
        boxes = ", ".join(f"{count} {kind}" for kind, count in sorted(self.boxes.items())) or "none"
        points = ", ".join(f"{count:,} {kind}" for kind, count in sorted(self.points.items())) or "none"
        return f"boxes: {boxes}\npoints: {points}\nscans with other labels: {self.scans}"


def merge(run: RunFiles, corrected: Path, out: Path) -> Merged:
    """Write the results of `run` with the corrections at `corrected` into `out`; return what changed.

    Parameters
    ----------
    corrected : boxes as `automos.writers.edits.read_edits` takes them, or a folder of .label files; scans without one
        stay as they are.
    out : a results folder: predictions/*.label with track ids, tracks.json, poses.txt and merge.json. `run` stays as it
        is.

    Raises
    ------
    InputError
        Corrections that do not belong to the recording, or `out` is the run's own folder or holds them.
    """
    if os.path.realpath(out) == os.path.realpath(run.folder):
        raise InputError(f"{out} holds the results that are to be corrected: choose another --out")
    if Path(os.path.realpath(corrected)).is_relative_to(os.path.realpath(out)):
        raise InputError(f"{out} holds the corrections, which would be written over: choose another --out")
    has_labels = corrected.is_dir() and any(corrected.glob("[!.]*.label"))
    if has_labels:
        require_known((path.stem for path in corrected.glob("[!.]*.label")), run, corrected)
    edits = {} if has_labels else read_edits(corrected, run)
    require_room(out, run.sequence)
    with held(out):
        remove_parts(out)
        for marker in (COMPLETE, RUN_FILE):  # written last: without it the results are not whole
            remove(out / marker)
        _remove_others(out, run.names)
        _copy_beside(run, out)
        merged, counts = _write_labels(run, corrected if has_labels else None, edits, out)
        tracks = _tracks(run, edits)
        write_json(out / "tracks.json", tracks)
        write_json(out / "merge.json", {"corrected": str(corrected), **vars(merged)}, indent=1)
        about = Workspace(run.folder).read_run()
        if about:
            n_moving = sum(track["verdict"] == "moving" for track in tracks["tracks"])
            about |= {"points": counts, "tracks": {"total": len(tracks["tracks"]), "moving": n_moving}}
            write_run(out, about)
    return merged


def _remove_others(out: Path, names: list[str]) -> None:
    """Remove what another run left of each scan in `out`, but for labels that are replaced.

    Its other scans would stay among these, and its confidences would be taken for those of these labels.
    """
    replaced = {out / "predictions" / f"{name}.label" for name in names}
    for path in per_scan_files(out):
        if path not in replaced:
            remove(path)


PerPoint = tuple[npt.NDArray[np.uint8], Ints]
"""Label and instance of each point of a scan."""


def _write_labels(
    run: RunFiles, corrected: Path | None, edits: dict[int, EditedScan], out: Path
) -> tuple[Merged, dict[str, int]]:
    """Write all label files with those in folder `corrected`, or `edits`; return what changed, and points by label."""
    (out / "predictions").mkdir(exist_ok=True)
    merged, counts = Merged(), no_points()
    for index in run.each("merging"):
        scan = run.scan(index)
        before = run.labels(index, len(scan)), run.instances(index, len(scan))
        if corrected is not None:
            after = _from_file(corrected / f"{run.names[index]}.label", before)
        elif index in edits:
            changes = compare(run.boxes_upright(index), edits[index])
            for change in changes:
                merged.boxes.update(change.kinds or ["unchanged"])
            after = relabel(run.points_upright(scan, index), scan.is_valid, *before, changes)
        else:
            after = before
        _count_changes(before[0], after[0], merged)
        count_points(counts, after[0])
        write_raw(out / "predictions" / f"{run.names[index]}.label", pack(*after))
    return merged, counts


def _from_file(path: Path, before: PerPoint) -> PerPoint:
    """Return the labels in a corrected file, of any SemanticKITTI class; without ids, points that move keep theirs."""
    if not is_there(path):
        return before
    packed = read_labels(path, len(before[0]))
    label = to_mos(packed)
    own = (packed >> 16).astype(np.int64)
    return label, np.where(label == Label.MOVING, own if own.any() else before[1], 0)


def _count_changes(before: npt.NDArray[np.uint8], after: npt.NDArray[np.uint8], merged: Merged) -> None:
    changed = before != after
    merged.scans += bool(changed.any())
    pairs, counts = np.unique(np.column_stack([before[changed], after[changed]]), axis=0, return_counts=True)
    for (was, now), count in zip(pairs, counts, strict=True):
        merged.points[f"{Label(was).name.lower()} to {Label(now).name.lower()}"] += int(count)


def _copy_beside(run: RunFiles, out: Path) -> None:
    """Copy what the results need to be read again: poses, settings, how the sensor moved in each sweep, the ground."""
    for name in ("poses.txt", "poses.tum", "settings.yaml"):
        if is_there(run.folder / name):
            copy_file(run.folder / name, out / name)
    keys = Workspace(run.folder).read_run().get("stages", {})
    for stage in (f"{name}-{keys.get(name)}" for name in ("odometry", "candidates")):
        if (run.folder / "stages" / stage).is_dir():
            place = out / "stages" / stage
            shutil.copytree(run.folder / "stages" / stage, place, copy_function=copy_file, dirs_exist_ok=True)


def _tracks(run: RunFiles, edits: dict[int, EditedScan]) -> dict[str, Any]:
    """Return tracks.json with the corrected boxes; a track's verdict is that of most of them, a person's is certain."""
    if not edits:
        return run.tracks_file
    boxes: dict[int, list[dict[str, Any]]] = {}
    verdicts: dict[int, Counter[str]] = {}
    touched: set[int] = set()
    before = {(track["id"], box["scan"]): box for track in run.tracks_file["tracks"] for box in track["boxes"]}
    for index in range(len(run)):
        for change in compare(run.boxes_upright(index), edits.get(index)):
            touched |= {change.track} if change.kinds else set()
            if change.after is None:
                continue
            box = before.get((change.track, index), {"observed": True, "velocity": [0.0, 0.0, 0.0]})
            if change.kinds:
                level = change.after.to_boxes().transformed(run.T_level_upright(index))
                center, size, yaw = (column[0].round(3).tolist() for column in (level.center, level.size, level.yaw))
                stamp = round(float(run.stamps[index]), 6)
                box = {**box, "center": center, "size": size, "scan": index, "stamp": stamp, "yaw": yaw}
            boxes.setdefault(change.track, []).append(box)
            verdicts.setdefault(change.track, Counter())[VERDICTS[change.after.verdict]] += 1
    known = {track["id"]: track for track in run.tracks_file["tracks"]}
    tracks = []
    for track in sorted(boxes):
        verdict = verdicts[track].most_common(1)[0][0]
        sure = {"id": track, "verdict": verdict, "confidence": 1.0, "p_moved": float(verdict == "moving")}
        tracks.append({**(sure if track in touched else known[track]), "boxes": boxes[track]})
    return {**run.tracks_file, "tracks": tracks}
