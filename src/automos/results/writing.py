"""Writes the results folder of a run: labels, poses, tracks, settings and a record of the run.

predictions/*.label   one uint32 per point, in the scan's order, named after the scan
confidences/*.npy     one float32 per point, the confidence of its label; on demand
poses.txt  poses.tum  sensor poses, KITTI and TUM
tracks.json           every object: verdict, confidence, a box per scan
settings.yaml         all settings that were used
run.json              versions, fingerprints, counts, timings, warnings
stages/               the results of each stage; deleting them costs only time
"""

import logging
import platform
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from automos import __version__
from automos.core.atomic import remove_parts, write_text
from automos.core.claims import remove
from automos.core.json_members import without_nan
from automos.core.labels import as_probability
from automos.core.pose_writers import write_kitti, write_tum
from automos.core.run import Progress, silent
from automos.core.scan import Sequence
from automos.core.workspace import COMPLETE, RUN_FILE, UNFINISHED, Workspace, write_run
from automos.objects.verdict import Verdict
from automos.odometry.clock import rate_of
from automos.odometry.trajectory import Trajectory
from automos.pipeline import Found
from automos.results.claiming import per_scan_files
from automos.results.point_files import count_points, no_points, write_points
from automos.results.recording_warnings import recording_warnings, scan_rate
from automos.results.tracks_file import track_entries, write_tracks
from automos.settings import OutputSettings, Settings, dump_yaml

_log = logging.getLogger(__name__)


def write_results(
    folder: Path,
    sequence: Sequence,
    result: Found,
    settings: Settings,
    progress: Progress = silent,
    is_whole: bool = True,
    poses: str | None = None,
) -> dict[str, Any]:
    """Write all result files of one recording into `folder`; return what run.json says.

    run.json comes last and names the fingerprint of the labels: while it is absent or names another, the label files
    are not to be trusted, and older ones are removed before the first new one is written. Where decisions of a review
    are to be applied afterwards (not `is_whole`), it says so until `declare_whole`. `poses` is a fingerprint of those
    that were given, None of the odometry's.
    """
    output = settings.output
    key = f"{result.keys['labels']}-{int(output.track_ids)}{int(output.confidence)}"
    before = Workspace(folder).read_run()
    if before.get("fingerprint") != key:
        # A recording that was cut into units has both of the former.
        for stale in (folder / COMPLETE, folder / RUN_FILE, *per_scan_files(folder)):
            remove(stale)
    elif not is_whole or "review" in before:
        write_run(folder, {**before, UNFINISHED: True})
    rate = rate_of(settings.recording, sequence.name)
    counts, n_body = _write_scans(folder, result, output, progress)
    trajectory = result.trajectory
    entries = track_entries(result.tracks, result.verdicts, trajectory)
    write_tables(folder, trajectory, settings, result.names, entries)
    run = {
        "fingerprint": key,
        "recording": {
            **about(sequence),
            **scan_rate(sequence, rate),
            "warnings": recording_warnings(sequence, rate),
        },
        "points": counts,
        "points_riding_along": n_body,
        "tracks": {"total": len(result.tracks), "moving": int((result.verdicts.verdict == Verdict.MOVING).sum())},
        "seconds": {**before.get("seconds", {}), **{k: round(v, 3) for k, v in result.seconds.items() if v}},
        "poses": poses,
        "odometry": without_nan(trajectory.diagnostics),
        "stages": dict(result.keys),
        "versions": versions(),
        **({} if is_whole else {UNFINISHED: True}),
    }
    write_run(folder, run)
    return run


def about(sequence: Sequence) -> dict[str, Any]:
    """Return what run.json says of a recording: among it, where other commands find it."""
    source = None if sequence.address is None else str(sequence.address.absolute())
    return {"name": sequence.name, "scans": len(sequence), "input": sequence.fingerprint(), "source": source}


def write_tables(
    folder: Path, trajectory: Trajectory, settings: Settings, names: list[str], entries: Iterable[dict[str, Any]]
) -> None:
    """Write poses, settings and tracks (`entries`) of the scans `names` into a results folder."""
    write_kitti(folder / "poses.txt", trajectory.T_world_sensor)
    write_tum(folder / "poses.tum", trajectory.T_world_sensor, trajectory.stamps)
    write_text(folder / "settings.yaml", dump_yaml(settings))
    write_tracks(folder / "tracks.json", trajectory, names, entries)


def declare_whole(folder: Path) -> dict[str, Any]:
    """Have run.json say that all decisions are applied; return its contents."""
    run = Workspace(folder).read_run()
    if run.pop(UNFINISHED, False):
        write_run(folder, run)
    return run


def _write_scans(folder: Path, result: Found, output: OutputSettings, progress: Progress) -> tuple[dict[str, int], int]:
    """Write what there is per point; return how many points have each label, and how many ride along."""
    for place in (folder, folder / "predictions", *([folder / "confidences"] if output.confidence else [])):
        place.mkdir(parents=True, exist_ok=True)
    remove_parts(folder)
    counts, n_body = no_points(), 0
    for i, name in enumerate(result.names):
        found = result.stage.load(name)
        n_body += int(found["n_body"])
        count_points(counts, found["label"])
        sure = as_probability(found["confidence"]) if output.confidence else None
        write_points(folder, name, found["label"], found["track"] if output.track_ids else None, sure)
        progress("writing", i + 1, len(result))
    return counts, n_body


def versions() -> dict[str, str]:
    """Return the versions of what shapes the labels."""
    found = {"automos": __version__, "python": platform.python_version()}
    for package in ("numpy", "scipy", "numba", "hdbscan", "small_gicp"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
