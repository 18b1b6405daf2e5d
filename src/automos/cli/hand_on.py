"""The commands `dataset` and `clean`: results as what trainers of networks, mappers and robots read."""

import re
from pathlib import Path
from typing import Annotated

import typer

from automos.cli.options import Format, console, output
from automos.core.errors import InputError

hand_on_app = typer.Typer()


@hand_on_app.command()
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
    from automos.core.progress import StageProgress
    from automos.results.open_run import open_run
    from automos.writers.training.make import make_training_set
    from automos.writers.training.sequence import Extras

    places: list[Path | None] = [*recordings] if recordings else [None] * len(results)
    if len(places) != len(results):
        raise InputError(f"{len(places)} --recordings for {len(results)} results folders: give one for each")
    extras, splits = Extras(_numbers(residuals), boxes), _splits(split or [])
    with StageProgress(console, "dataset") as progress:
        runs = [
            open_run(folder, recording, format, progress, deskewed=True)
            for folder, recording in zip(results, places, strict=True)
        ]
        made = make_training_set(runs, out, layout, ids, splits, extras)
    for sentence in (*made.sentences(), f"data set in {out}"):
        output.print(sentence, markup=False)


@hand_on_app.command()
def clean(
    results: Annotated[Path, typer.Argument(help="a results folder of automos label")],
    out: Annotated[Path, typer.Option(help="folder to write to; a new one, or one that this command began")],
    recording: Annotated[
        Path | None, typer.Argument(help="the recording, if it is no longer where it was when it was labelled")
    ] = None,
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
    from automos.core.progress import StageProgress
    from automos.results.open_run import open_run
    from automos.writers.cleaning.clean import Choice
    from automos.writers.cleaning.clean import clean as clean_recording

    if keep_unsure and only_movers:
        raise InputError("--keep-unsure and --only-movers exclude each other: give one of them")
    choice = Choice.MOVING if only_movers else Choice.NOT_MOVING if keep_unsure else Choice.STATIC
    with StageProgress(console, "clean") as progress:
        run = open_run(results, recording, format, progress)
        written, points, left_out = clean_recording(run, out, as_, choice)
    share = 100.0 * left_out / max(points, 1)
    output.print(f"{written}: {left_out:,} of {points:,} points left out ({share:.2f} %)", markup=False)


def _splits(given: list[str]) -> dict[str, str]:
    """Return the split of each recording that is named, of texts SPLIT=NAME."""
    found: dict[str, str] = {}
    for text in given:
        split, equals, name = text.partition("=")
        if not equals or name in found:
            raise InputError(f"--split {text}: write SPLIT=NAME, each recording once, as in valid=drive_7")
        found[name] = split
    return found


def _numbers(text: str) -> tuple[int, ...]:
    """Return the numbers in a list like 1-8,11; InputError where it is none."""
    found: list[int] = []
    for part in filter(None, text.split(",")):
        bounds = re.fullmatch(r"([1-9]\d{0,2})(?:-([1-9]\d{0,2}))?", part.strip())
        if bounds is None:
            raise InputError(f"--residuals {text}: write numbers from 1 to 999 as in 1-8 or 1-11,13")
        found += range(int(bounds[1]), int(bounds[2] or bounds[1]) + 1)
    return tuple(dict.fromkeys(found))
