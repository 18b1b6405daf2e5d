"""The commands `label`, `status` and `settings`: label one recording or thousands, and show the progress."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from automos.cli.options import (
    Calib,
    Format,
    Overrides,
    Poses,
    Preset,
    Rate,
    Recordings,
    SettingsFile,
    Workers,
    app,
    console,
    output,
    progress_of,
    read_settings,
)
from automos.core.errors import InputError

if TYPE_CHECKING:
    from automos.fleet.label import GivenPoses
    from automos.fleet.sources import Recording, Shard
    from automos.settings import Settings

NOT_ALL = 3
"""Exit code of a run that labelled some recordings and not others."""


@app.command()
def label(
    recording: Recordings,
    out: Annotated[str | None, typer.Option(help="results folder or URL; default: automos_runs/NAME")] = None,
    preset: Preset = "default",
    settings: SettingsFile = None,
    set_: Overrides = None,
    format: Format = None,
    poses: Poses = None,
    calib: Calib = None,
    rate: Rate = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace results with other poses")] = False,
    moving: Annotated[str | None, typer.Option(help="sequence: moved at some time; now: moves in this scan")] = None,
    unsure: Annotated[float | None, typer.Option(help="write 0 for points whose confidence is lower")] = None,
    confidence: Annotated[bool, typer.Option("--confidence", help="write the confidence of each label")] = False,
    workers: Workers = 0,
    ray: Annotated[str | None, typer.Option(help="work on a Ray cluster: its address, or auto")] = None,
    shard: Annotated[str | None, typer.Option(help="i/n: every n-th recording from number i on, from 0")] = None,
    memory: Annotated[float, typer.Option(min=0.1, help="GB that a worker needs")] = 3.0,
    cache: Annotated[float, typer.Option(min=0.0, help="GB of disk for copies of what comes from a URL")] = 50.0,
    work: Annotated[Path | None, typer.Option(help="folder for these; default: a temporary folder")] = None,
    chunk: Annotated[int, typer.Option(min=1, help="scans per unit of work of recordings over twice as long")] = 600,
    dry_run: Annotated[bool, typer.Option(help="only list what would be done")] = False,
) -> None:
    """Label every point of every scan as moving or static.

    [bold]Examples[/bold]

    automos label my_log/                       a folder of .bin, .pcd, .ply, .npy or .xyz scans

    automos label kitti/sequences/07 --out 07/  a KITTI sequence; its poses are not used

    automos label my_log/ --poses poses.tum     poses from your own SLAM

    automos label fleet/ --out labels/          every recording in a folder, on all cores; repeat it for the rest

    automos label s3://bucket/logs --out s3://bucket/labels --ray auto
    """
    from automos.fleet.label import Resources, has_one_process_enough
    from automos.fleet.sources import alone, describe, find_all, name_of, parse_shard, take_shard
    from automos.fleet.storage import shown
    from automos.labeling import require_poses_of_one

    options = {"recording.rate": rate, "labels.moving": moving, "labels.unsure": unsure}
    chosen = read_settings(settings, set_, {**options, "output.confidence": confidence or None}, preset)
    part, files = parse_shard(shard), (poses, calib, overwrite)
    found = alone(find_all(recording, format), part, out)
    target = out or f"automos_runs/{found[0].name if len(found) == 1 else name_of(recording)}"
    resources = Resources(workers, ray, memory, cache, chunk=chunk, **({} if work is None else {"work": work}))
    mine = take_shard(found, part)
    require_poses_of_one(poses, calib, len(found), shown(recording))
    if dry_run:
        for one in mine:
            output.print(f"{one.name}: {describe(one)} -> {shown(one.target(target))}")
    elif found[0].folder == "" and has_one_process_enough(found, target, resources):
        _label_here(found[0], Path(target), out is None, chosen, files, workers)
    else:
        _label_all(mine, shown(recording), target, part, settings=chosen, resources=resources, poses=files)


def _label_here(
    found: Recording, folder: Path, is_default: bool, settings: Settings, poses: GivenPoses, workers: int
) -> None:
    """Label one recording in this process and say what was found; `is_default`: nobody chose the folder."""
    from automos.compiling import compiling_beside
    from automos.core.workspace import Workspace
    from automos.labeling import label_recording, summary
    from automos.readers import open_sequence
    from automos.results.claiming import refuse_others_results

    sequence = open_sequence(found.source, found.format)
    if is_default:
        refuse_others_results(folder, sequence)
    began, before = time.perf_counter(), Workspace(folder).read_run()
    with compiling_beside(console.print, ("candidates", "objects")):
        run = label_recording(sequence, folder, settings, *poses[:2], workers, console, overwrite=poses[2])
    output.print(summary(run, folder, time.perf_counter() - began, run == before))


def _label_all(found: list[Recording], name: str, target: str, part: Shard | None, **how: Any) -> None:
    """Label many recordings, by processes or on a cluster; exit with `NOT_ALL` where some could not be.

    Raises
    ------
    InputError : the one recording that there is could not be labelled.
    """
    from automos.fleet.label import closing_lines, label_fleet

    with progress_of(name, "recordings") as progress:
        how["progress"] = lambda n, bad, total: progress("labelled", n + bad, total)
        outcome = label_fleet(found, target, shard=part, **how)
    if outcome.failed and len(found) == 1 and part is None:  # as where one process labels it
        raise InputError(*outcome.failed.values())
    for line in closing_lines(outcome, target):
        output.print(line)
    if outcome.failed:
        raise typer.Exit(NOT_ALL)


@app.command()
def status(
    run: Annotated[str, typer.Argument(help="the --out of automos label over several recordings")],
    as_json: Annotated[bool, typer.Option("--json", help="print the whole ledger as JSON")] = False,
) -> None:
    """Show the progress of a run over several recordings: rate, remaining time, failures and their reasons."""
    from automos.fleet.status import read_status

    found = read_status(run)
    output.print(found.to_json() if as_json else "\n".join(found.lines()))


@app.command("settings")
def show_settings(preset: Preset = "default", settings: SettingsFile = None, set_: Overrides = None) -> None:
    """Print all settings as YAML; the output is a settings file."""
    from automos.settings import dump_yaml

    output.print(dump_yaml(read_settings(settings, set_, preset=preset)), end="")
