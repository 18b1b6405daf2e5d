"""The commands that simulate: parse, call one function, print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from automos.cli.consoles import console, output
from automos.cli.options import Preset

worlds_app = typer.Typer()


@worlds_app.command()
def demo(
    out: Annotated[Path, typer.Option(help="folder for the picture and the report")] = Path("automos_demo"),
    preset: Preset = "default",
) -> None:
    """Simulate a street, label it, score it and draw it: the first minute."""
    from automos.compiling import compiling_beside
    from automos.demo import run_demo
    from automos.progress import StageProgress
    from automos.settings import load_settings

    with compiling_beside(console.print, knows_poses=False), StageProgress(console, "street") as progress:
        made = run_demo(out, load_settings(preset), progress)
    output.print(
        f"IoU of the moving class {100 * made.scores.iou:.1f} % (precision {100 * made.scores.precision:.1f} %, "
        f"recall {100 * made.scores.recall:.1f} %)\npicture: {made.picture}\nreport:  {made.report}"
    )


@worlds_app.command()
def simulate(
    out: Annotated[Path, typer.Argument(help="folder to write the recording into")],
    scenario: Annotated[str, typer.Option(help="the world; an unknown name lists all")] = "city",
    sensor: Annotated[str, typer.Option(help="the LiDAR; an unknown name lists all")] = "HDL-64E",
    scans: Annotated[int, typer.Option(help="length")] = 100,
    seed: Annotated[int, typer.Option(help="another seed, another world")] = 0,
    compensated: Annotated[bool, typer.Option(help="take the sensor's motion out of every sweep")] = False,
    workers: Annotated[int, typer.Option(min=0, help="processes; 0: one per core")] = 0,
) -> None:
    """Write a simulated recording with exact truth, in SemanticKITTI's layout."""
    from automos import simulation
    from automos.progress import StageProgress

    sequence = simulation.simulate(scenario, sensor, scans, seed, compensated)
    with StageProgress(console, sequence.name) as progress:
        simulation.write(sequence, out, workers, progress)
    output.print(f"{len(sequence)} scans in {out}")
