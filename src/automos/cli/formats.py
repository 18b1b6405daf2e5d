"""The commands `formats`, `export` and `merge`: list formats, write results in them, and read corrections back."""

from pathlib import Path
from typing import Annotated

import typer

from automos.cli.options import Format, console, output

formats_app = typer.Typer()

Results = Annotated[Path, typer.Argument(help="a results folder of automos label")]
Recording = Annotated[Path, typer.Argument(help="the recording that the results were made from")]


@formats_app.command()
def formats() -> None:
    """List the formats that can be read and written, and what each needs."""
    from automos.core.extras import pip_install
    from automos.writers.listing import format_tables

    for table in format_tables():
        output.print(table)
    output.print(f"An extra is installed by  {pip_install('EXTRA')}")


@formats_app.command()
def export(
    results: Results,
    to: Annotated[str, typer.Option(help="the format to write; automos formats lists all")],
    recording: Annotated[
        Path | None, typer.Argument(help="the recording, if it is no longer where it was when it was labelled")
    ] = None,
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
    from automos.core.progress import StageProgress
    from automos.readers import open_recordings
    from automos.results.open_run import open_run
    from automos.writers import export_run

    recordings = (
        [open_run(results, format=format).sequence] if recording is None else open_recordings(recording, format)
    )
    with StageProgress(console, to) as progress:
        for written in export_run(results, recordings, to, out, progress, deskewed):
            output.print(written)


@formats_app.command()
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
    from automos.core.progress import StageProgress
    from automos.readers import open_sequence
    from automos.results.run_files import RunFiles
    from automos.writers.merge import merge as merge_corrections

    with StageProgress(console, "merge") as progress:
        run = RunFiles(results, open_sequence(recording, format), progress)
        merged = merge_corrections(run, corrected, out or results / "merged")
    output.print(f"{merged.summary()}\nmerged results in {out or results / 'merged'}")
