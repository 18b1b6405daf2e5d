"""The commands `demo` and `simulate`."""

from pathlib import Path
from typing import Annotated

import typer

from automos.cli.options import Preset, app, console, output, progress_of, read_settings
from automos.core.errors import InputError


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="folder for the picture and the report")] = Path("automos_demo"),
    preset: Preset = "default",
) -> None:
    """Simulate a street, label it, score the labels and draw them."""
    from automos.cli.demo import run_demo
    from automos.compiling import SHARES, compiling_beside

    with compiling_beside(console.print, SHARES), progress_of("street") as progress:
        made = run_demo(out, read_settings(None, None, preset=preset), progress)
    output.print(
        f"IoU of the moving class {100 * made.scores.iou:.1f} % (precision {100 * made.scores.precision:.1f} %, "
        f"recall {100 * made.scores.recall:.1f} %)\npicture: {made.picture}\nreport:  {made.report}"
    )


@app.command()
def simulate(
    out: Annotated[Path, typer.Argument(help="folder to write the recording into")],
    scenario: Annotated[str, typer.Option(help="the world; an unknown name lists all")] = "city",
    sensor: Annotated[str, typer.Option(help="the LiDAR; an unknown name lists all")] = "HDL-64E",
    scans: Annotated[int, typer.Option(help="length")] = 100,
    seed: Annotated[int, typer.Option(help="another seed, another world")] = 0,
    compensated: Annotated[bool, typer.Option(help="remove the sensor's motion from every sweep")] = False,
    convention: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=VALUE, repeatable: conventions of a recorder (turns=1.09, order=time); a wrong one lists all"
        ),
    ] = None,
    rig: Annotated[str, typer.Option(help="what carries the sensor; an unknown name lists all")] = "car",
    weather: Annotated[str, typer.Option(help="an unknown name lists all")] = "clear",
    blooming: Annotated[bool, typer.Option(help="bright signs bleed into neighbouring beams")] = False,
    lidars: Annotated[int, typer.Option(help="sensors on the vehicle, their clouds merged")] = 1,
    bag: Annotated[bool, typer.Option("--bag", help="OUT/bag as well: a ROS 2 bag with an IMU")] = False,
    workers: Annotated[int, typer.Option(min=0, help="processes; 0: one per core")] = 0,
) -> None:
    """Write a simulated recording with exact ground truth, in SemanticKITTI's layout.

    With a convention, a rig, weather or several LiDARs, it is written as a recorder would store it, with labels and
    poses, but without boxes.
    """
    from automos import simulation

    conditions = simulation.Conditions(rig, weather, blooming)
    if convention or conditions != simulation.Conditions() or lidars != 1:
        kept = simulation.Convention.parse(convention or [])
        if bag:
            raise InputError("--bag goes with the plain recording: give no convention, rig, weather or second LiDAR.")
        if compensated:
            raise InputError("--compensated goes with the plain recording; give --convention reference=middle instead.")
        recorded = simulation.record(
            scenario, sensor, scans, seed, convention=kept, conditions=conditions, n_lidars=lidars
        )
        simulation.write_recorded(recorded, out)
        output.print(f"{len(recorded)} scans in {out} ({kept})")
        return
    sequence = simulation.simulate(scenario, sensor, scans, seed, compensated)
    with progress_of(sequence.name) as progress:
        simulation.write(sequence, out, workers, progress, bag)
    output.print(f"{len(sequence)} scans in {out}")
