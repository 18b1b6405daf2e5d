"""The commands `compare` and `map`: compare methods on one recording, and make maps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from automos.cli.options import Calib, Format, Poses, Recording, Workers, app, console, output, pair, read_settings
from automos.core.atomic import held
from automos.core.errors import InputError

if TYPE_CHECKING:
    from automos.baselines.comparison.runs import MethodRuns
    from automos.core.run import Progress
    from automos.core.scan import Sequence

Out = Annotated[Path | None, typer.Option(help="folder for labels, tables and pictures; a second run continues there")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help="one setting, tracking.max_gap=0.5, ...")]


@app.command()
def compare(
    recording: Recording,
    methods: Annotated[list[str] | None, typer.Option("--method", help="a method; repeatable; default: all")] = None,
    out: Out = None,
    scan: Annotated[int | None, typer.Option(help="the scan to draw; default: the one with most movers")] = None,
    radius: Annotated[float, typer.Option(help="metres around the sensor that are drawn")] = 40.0,
    poses: Annotated[
        str, typer.Option(help="own: each preset its own, the default's for others; shared: one for all; or a file")
    ] = "own",
    predictions: Annotated[
        list[str] | None, typer.Option(help="NAME=FOLDER of .label files from another program; repeatable")
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, max=100, help="how often each method runs; seconds are the median")] = 1,
    calib: Calib = None,
    set_: Overrides = None,
    format: Format = None,
    workers: Workers = 0,
) -> None:
    """Compare the methods of the paper's Table I, and newer ones, on one recording.

    Methods run one after the other, each in its own process. If the recording has ground truth, they are scored;
    otherwise there is a picture, and a table of their agreement.

    [bold]Examples[/bold]

    automos compare kitti/sequences/07

    automos compare my_log/ --method removert --method dufomap --method default

    automos compare kitti/sequences/08 --predictions 4DMOS=4dmos/08 --predictions MapMOS=mapmos/08 --repeat 3
    """
    from automos.baselines.comparison.compare import compare as compare_methods
    from automos.baselines.comparison.compare import require_scan, write_comparison
    from automos.baselines.methods import choose_methods
    from automos.core.scan import MAX_RANGE
    from automos.readers import open_sequence

    if not 1.0 <= radius < MAX_RANGE:
        raise InputError(f"--radius {radius:g} is not possible: give 1 to {MAX_RANGE:g} metres around the sensor")
    chosen = choose_methods(methods)
    file = None if poses in ("own", "shared") else Path(poses)
    usage = "give a name and a folder of .label files, as 4DMOS=results/4dmos/08"
    others = {name: Path(folder) for name, folder in pair(predictions, "--predictions", usage).items()}
    more = {"repeats": repeat, "predictions": others, "workers": workers}
    sequence = open_sequence(recording, format)
    folder = out or Path("automos_compare") / sequence.name
    with _runs(sequence, folder, (file, calib), set_, shared=poses == "shared", **more) as runs:
        require_scan(runs, scan)  # before anything takes hours
        comparison = compare_methods(runs, chosen)
        for table in comparison.tables():
            output.print(table)
        for path in write_comparison(runs, comparison, radius, scan):
            output.print(path)


@app.command("map")
def make_map(
    recording: Annotated[Path, typer.Argument(help="a recording, or a results folder: its labels as corrected")],
    moved: Annotated[Path | None, typer.Argument(help="of results: the recording, if it is elsewhere now")] = None,
    out: Out = None,
    kinds: Annotated[list[str] | None, typer.Option("--kind", help="ply, pcd or laz; repeatable; default: ply")] = None,
    method: Annotated[
        str | None, typer.Option(help="whose labels: default, paper, or a method of automos compare")
    ] = None,
    voxel: Annotated[float | None, typer.Option(help="metres, one point of the map per voxel; default: 0.1")] = None,
    poses: Poses = None,
    calib: Calib = None,
    set_: Overrides = None,
    format: Format = None,
    workers: Workers = 0,
) -> None:
    """Write the map of a recording without moving objects, and pictures of it before and after.

    [bold]Examples[/bold]

    automos map automos_runs/my_log                        with the labels of automos label, as corrected in a review

    automos map my_log/ --kind laz --voxel 0.05

    automos map kitti/sequences/07 --method removert       also scored: the recording has ground truth
    """
    from automos.baselines.methods import choose_methods
    from automos.core.workspace import Workspace
    from automos.readers import open_sequence
    from automos.results.open_run import open_run
    from automos.writers.maps.writers import check_kind

    overrides = [*(set_ or []), *([] if voxel is None else [f"map.voxel={voxel}"])]
    place, wanted = out or Path("automos_map"), list(dict.fromkeys(kinds or ["ply"]))
    for kind in wanted:  # before minutes of labelling
        check_kind(place / f"map.{kind}")
    if Workspace(recording).read_run():
        if (method, poses, calib) != (None, None, None):
            raise InputError(f"{recording} holds labels and poses: leave --method, --poses and --calib out")
        run = open_run(recording, moved, format)
        folder = out or place / run.sequence.name
        settings = read_settings(None, overrides).map
        with held(folder):
            _write(run.frames, run.sequence, run.labels, folder, wanted, settings)
        return
    if moved is not None:
        raise InputError(
            f"{recording} is no results folder of automos label, so {moved} is not its recording: give one"
        )
    (chosen,) = choose_methods([method or "default"])
    sequence = open_sequence(recording, format)
    with _runs(sequence, out or place / sequence.name, (poses, calib), overrides, workers=workers) as runs:
        runs.cost(chosen)
        settings = runs.settings(chosen).map
        _write(runs.frames, sequence, lambda i, n: runs.labels(chosen, i, n) & 0xFFFF, runs.folder, wanted, settings)


def _write(frames: Any, sequence: Sequence, labels: Any, folder: Path, kinds: list[str], settings: Any) -> None:
    """Write the map, and print its scores and files."""
    from automos.writers.maps.make_map import make_map as write_map
    from automos.writers.maps.make_map import scores_by_name

    made = write_map(frames, sequence, labels, folder, kinds, settings, _say_when_started())
    if made.scores is not None:
        output.print("  ".join(f"{name} {100 * value:.1f}" for name, value in scores_by_name(made.scores).items()))
    output.print(f"{made.n_points:,} points")
    for file in made.files:
        output.print(file)


@contextmanager
def _runs(
    sequence: Sequence, folder: Path, files: tuple[Path | None, Path | None], set_: list[str] | None, **more: Any
) -> Iterator[MethodRuns]:
    """Give the runs of methods in a folder that no other process writes into meanwhile."""
    from automos.baselines.comparison.runs import MethodRuns
    from automos.labeling import given_poses
    from automos.settings import read_overrides

    poses, chosen = given_poses(sequence, *files), read_overrides(set_)
    with held(folder):
        yield MethodRuns(sequence, folder, chosen, poses, progress=_say_when_started(), **more)


def _say_when_started() -> Progress:
    said: set[str] = set()

    def report(what: str, done: int, total: int) -> None:
        if what not in said:
            said.add(what)
            console.print(f"{what}: {total} scans")

    return report
