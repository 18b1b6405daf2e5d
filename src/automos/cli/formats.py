"""The commands that write results for others: `formats`, `export`, `merge`, `dataset` and `clean`.

They list formats, write results in them, read corrections back, and write what trainers of networks, mappers and robots
read.
"""

import re
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table

from automos.cli.options import Format, Moved, Results, app, output, pair, progress_of
from automos.core.errors import InputError

Recording = Annotated[Path, typer.Argument(help="the recording that the results were made from")]


@app.command()
def formats() -> None:
    """List the formats that can be read and written, and what each needs."""
    from automos.core.extras import pip_install
    from automos.readers import FORMATS, load_format
    from automos.readers.codecs import CODECS
    from automos.writers import EXPORTS, load_export

    recordings = _table("recordings that are read", "--format", "what it looks like", "truth", "extra")
    for name in FORMATS:
        format = load_format(name)
        recordings.add_row(name, format.layout, format.truth or "-", format.needs or "-")
    files = _table("point files that are read", "--format", "what it is")
    for name, description in CODECS.items():
        files.add_row(name, description)
    results = _table("formats that results are written in", "--to", "what it makes", "extra")
    for name in EXPORTS:
        export = load_export(name)
        results.add_row(name, export.writes, export.needs or "-")
    for table in (recordings, files, results):
        output.print(table)
    output.print(f"An extra is installed by  {pip_install('EXTRA')}")


def _table(title: str, *headings: str) -> Table:
    columns = (Column(heading, overflow="fold") for heading in headings)
    return Table(*columns, title=title, title_justify="left")


@app.command()
def export(
    results: Results,
    to: Annotated[str, typer.Option(help="the format to write; automos formats lists all")],
    recording: Moved = None,
    out: Annotated[Path | None, typer.Option(help="file or folder to write; default: RESULTS/export/FORMAT")] = None,
    deskewed: Annotated[bool, typer.Option("--deskewed", help="write motion-compensated points")] = False,
    format: Format = None,
) -> None:
    """Write labels, boxes and tracks in the format of another tool.

    [bold]Examples[/bold]

    automos export automos_runs/log --to pcd                points with their labels

    automos export automos_runs/log --to ply --deskewed     ... motion-compensated

    automos export automos_runs/log --to cvat --out task/   boxes to correct in CVAT

    automos export automos_runs/11 kitti/sequences/11 --to semantickitti --out submission.zip
    """
    from automos.readers import open_recordings
    from automos.results.open_run import open_run
    from automos.writers import export_run

    recordings = (
        [open_run(results, format=format).sequence] if recording is None else open_recordings(recording, format)
    )
    with progress_of(to) as progress:
        for written in export_run(results, recordings, to, out, progress, deskewed):
            output.print(written)


@app.command()
def merge(
    results: Results,
    recording: Recording,
    corrected: Annotated[
        Path, typer.Argument(help="a SUSTechPOINTS scene, CVAT's export as Datumaro 3D, or a folder of .label files")
    ],
    out: Annotated[Path | None, typer.Option(help="folder for the merged results; default: RESULTS/merged")] = None,
    format: Format = None,
) -> None:
    """Merge boxes or labels that were corrected in another tool into a run's labels, and count the changes."""
    from automos.readers import open_sequence
    from automos.results.run_files import RunFiles
    from automos.writers.merge import merge as merge_corrections

    with progress_of("merge") as progress:
        run = RunFiles(results, open_sequence(recording, format), progress)
        merged = merge_corrections(run, corrected, out or results / "merged")
    output.print(f"{merged.summary()}\nmerged results in {out or results / 'merged'}")


@app.command()
def dataset(
    results: Annotated[list[Path], typer.Argument(help="results folders of automos label")],
    out: Annotated[Path, typer.Option(help="folder of the data set; a new one, or one that this command began")],
    layout: Annotated[str, typer.Option(help="semantickitti, or helimos for sensors other than KITTI's")],
    ids: Annotated[str, typer.Option(help="universal: 0, 99, 259, for all trainers; mos: 0, 9, 251")] = "universal",
    split: Annotated[list[str] | None, typer.Option(help="valid=NAME or test=NAME of a recording; repeatable")] = None,
    recordings: Annotated[
        list[Path] | None, typer.Option(help="the recordings, one for each of RESULTS, if they were moved; repeatable")
    ] = None,
    residuals: Annotated[str, typer.Option(help="residual images so many scans back: 1-8 or 1-11,13,15,16,19,22")] = "",
    boxes: Annotated[bool, typer.Option("--boxes", help="InsMOS's boxes")] = False,
    format: Format = None,
) -> None:
    """Make one data set of many runs, for trainers of moving-object segmentation.

    [bold]Examples[/bold]

    automos dataset automos_runs/* --out set --layout helimos --split valid=drive_7      4DMOS, MapMOS

    automos dataset automos_runs/* --out set --layout semantickitti --residuals 1-8      MotionSeg3D
    """
    from automos.results.open_run import open_run
    from automos.writers.training.make import make_training_set
    from automos.writers.training.sequence import Extras

    places: list[Path | None] = [*recordings] if recordings else [None] * len(results)
    if len(places) != len(results):
        raise InputError(f"{len(places)} --recordings for {len(results)} results folders: give one for each")
    extras = Extras(_numbers(residuals), boxes)
    splits = pair(split, "--split", "write SPLIT=NAME, as in valid=drive_7", key=1)
    with progress_of("dataset") as progress:
        pairs = zip(results, places, strict=True)
        runs = [open_run(folder, place, format, progress, deskewed=True) for folder, place in pairs]
        made = make_training_set(runs, out, layout, ids, splits, extras)
    for sentence in (*made.sentences(), f"data set in {out}"):
        output.print(sentence, markup=False)


@app.command()
def clean(
    results: Results,
    out: Annotated[Path, typer.Option(help="folder to write to; a new one, or one that this command began")],
    recording: Moved = None,
    as_: Annotated[str | None, typer.Option("--as", help="bin, pcd, laz, mcap; default: its own kind")] = None,
    keep_unsure: Annotated[bool, typer.Option("--keep-unsure", help="keep points without a label, too")] = False,
    only_movers: Annotated[bool, typer.Option("--only-movers", help="keep moving points, and no others")] = False,
    format: Format = None,
) -> None:
    """Write the recording again without moving points; in a bag, all else stays as it is.

    [bold]Examples[/bold]

    automos clean automos_runs/log --out clean/                 for mapping: static points only

    automos clean automos_runs/log --out clean/ --keep-unsure   ... and what has no label
    """
    from automos.results.open_run import open_run
    from automos.writers.cleaning.clean import Choice
    from automos.writers.cleaning.clean import clean as clean_recording

    if keep_unsure and only_movers:
        raise InputError("--keep-unsure and --only-movers exclude each other: give one of them")
    choice = Choice.MOVING if only_movers else Choice.NOT_MOVING if keep_unsure else Choice.STATIC
    with progress_of("clean") as progress:
        run = open_run(results, recording, format, progress)
        written, points, left_out = clean_recording(run, out, as_, choice)
    share = 100.0 * left_out / max(points, 1)
    output.print(f"{written}: {left_out:,} of {points:,} points left out ({share:.2f} %)", markup=False)


def _numbers(text: str) -> tuple[int, ...]:
    """Return the numbers in a list like 1-8,11; InputError where it is none."""
    found: list[int] = []
    for part in filter(None, text.split(",")):
        bounds = re.fullmatch(r"([1-9]\d{0,2})(?:-([1-9]\d{0,2}))?", part.strip())
        if bounds is None:
            raise InputError(f"--residuals {text}: write numbers from 1 to 999 as in 1-8 or 1-11,13")
        found += range(int(bounds[1]), int(bounds[2] or bounds[1]) + 1)
    return tuple(dict.fromkeys(found))
