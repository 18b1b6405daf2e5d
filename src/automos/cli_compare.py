"""The commands that set methods side by side and make maps: parse, call one function, print."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

compare_app = typer.Typer()
console = Console(stderr=True)
output = Console(highlight=False, markup=False, soft_wrap=True)

Recording = Annotated[Path, typer.Argument(help="a folder of scans, a data set, a bag: see automos formats")]
Out = Annotated[Path | None, typer.Option(help="folder for labels, tables and pictures; a second run goes on there")]
Poses = Annotated[Path | None, typer.Option(help="poses to use instead of odometry: KITTI or TUM file")]
Calib = Annotated[Path | None, typer.Option(help="calib.txt with Tr:, if the poses are the camera's")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help="one setting, baselines.removert.voxel=0.1, ...")]
Format = Annotated[str | None, typer.Option("--format", help="the recording's format, where guessing fails")]
Workers = Annotated[int, typer.Option(min=0, help="processes; 0: one per core")]


@compare_app.command()
def compare(
    recording: Recording,
    methods: Annotated[list[str] | None, typer.Option("--method", help="one method; repeatable; all if none")] = None,
    out: Out = None,
    scan: Annotated[int | None, typer.Option(help="the scan that is drawn [default: the one with most movers]")] = None,
    radius: Annotated[float, typer.Option(help="metres around the sensor that are drawn")] = 40.0,
    poses: Poses = None,
    calib: Calib = None,
    set_: Overrides = None,
    format: Format = None,
    workers: Workers = 0,
) -> None:
    """Set every method of the paper's Table I, and newer ones, side by side on one recording.

    All are given the same poses. Where the recording has truth they are scored; without, the picture and the table of
    how far they agree remain.

    [bold]Examples[/bold]

    automos compare kitti/sequences/07

    automos compare my_log/ --method removert --method dufomap --method default
    """
    from automos.comparison.compare import compare as compare_methods
    from automos.comparison.compare import write_comparison
    from automos.comparison.labelers import choose_methods

    chosen = choose_methods(methods)
    runs = _runs(recording, out or Path("automos_compare"), out is None, poses, calib, set_, format, workers)
    comparison = compare_methods(runs, chosen)
    for table in comparison.tables():
        output.print(table)
    for path in write_comparison(runs, comparison, radius, scan):
        output.print(path)


def _runs(
    recording: Path,
    out: Path,
    is_default: bool,
    poses: Path | None,
    calib: Path | None,
    overrides: list[str] | None,
    format: str | None,
    workers: int,
) -> Any:
    from automos.comparison.runs import MethodRuns
    from automos.datasets import open_sequence
    from automos.pose_files import read_calib, read_poses
    from automos.settings import read_overrides

    sequence = open_sequence(recording, format)
    given = None
    if poses is not None:
        T_camera_sensor = None if calib is None else read_calib(calib)
        given = read_poses(poses, len(sequence), sequence.stamps, T_camera_sensor, sequence.names)
    folder = out / sequence.name if is_default else out
    return MethodRuns(sequence, folder, read_overrides(overrides), given, workers, _say_when_started())


def _say_when_started() -> Callable[[str, int, int], None]:
    said: set[str] = set()

    def tell(what: str, done: int, total: int) -> None:
        if what not in said:
            said.add(what)
            console.print(f"{what}: {total} scans")

    return tell
