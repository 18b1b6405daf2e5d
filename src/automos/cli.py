"""The command line: parse, call one function, print."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from automos.cli_compare import compare_app
from automos.cli_formats import formats_app
from automos.cli_label import label_app
from automos.cli_look import look_app
from automos.cli_network import network_app
from automos.cli_options import Format, Overrides, Preset, Recording, SettingsFile
from automos.errors import AutomosError, InputError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Automatic moving/static labels for every point of a LiDAR recording.",
)
app.add_typer(label_app)
app.add_typer(formats_app)
app.add_typer(compare_app)
app.add_typer(network_app)
app.add_typer(look_app)
console = Console(stderr=True)
output = Console(highlight=False, markup=False, soft_wrap=True)


@app.command()
def evaluate(
    predictions: Annotated[Path, typer.Argument(help="a results folder, or a folder of .label files")],
    recording: Recording,
    format: Format = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="write the scores here")] = None,
) -> None:
    """Score labels against the truth that came with a recording, as SemanticKITTI's moving-object benchmark does."""
    from automos.datasets import open_recordings
    from automos.evaluation.report import evaluate_recordings

    report = evaluate_recordings(predictions, open_recordings(recording, format))
    output.print(report.table())
    if json_file is not None:
        from automos.atomic import write_text

        write_text(json_file, report.to_json())


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="folder for the picture and the report")] = Path("automos_demo"),
    preset: Preset = "default",
) -> None:
    """Simulate a street, label it, score it and draw it: the first minute."""
    from automos.demo import run_demo
    from automos.progress import StageProgress
    from automos.settings import load_settings

    with StageProgress(console, "street") as progress:
        made = run_demo(out, load_settings(preset), progress)
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
    compensated: Annotated[bool, typer.Option(help="take the sensor's motion out of every sweep")] = False,
    convention: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=VALUE, repeatable: how a recorder keeps it (turns=1.09, order=time); a wrong one lists all"
        ),
    ] = None,
    rig: Annotated[str, typer.Option(help="what carries the sensor; an unknown name lists all")] = "car",
    weather: Annotated[str, typer.Option(help="an unknown name lists all")] = "clear",
    blooming: Annotated[bool, typer.Option(help="bright signs bleed into the beams beside them")] = False,
    lidars: Annotated[int, typer.Option(help="sensors on the vehicle, their clouds merged")] = 1,
    workers: Annotated[int, typer.Option(min=0, help="processes; 0: one per core")] = 0,
) -> None:
    """Write a simulated recording with exact truth, in SemanticKITTI's layout.

    With a convention, a rig, weather or several LiDARs it is written as a recorder would have kept it, with labels and
    poses, but without boxes.
    """
    from automos import simulation
    from automos.progress import StageProgress

    conditions = simulation.Conditions(rig, weather, blooming)
    if convention or conditions != simulation.Conditions() or lidars != 1:
        kept = simulation.Convention.parse(convention or [])
        if compensated:
            raise InputError("--compensated goes with the plain recording; give --convention reference=middle instead.")
        recorded = simulation.record(
            scenario, sensor, scans, seed, convention=kept, conditions=conditions, n_lidars=lidars
        )
        simulation.write_recorded(recorded, out)
        output.print(f"{len(recorded)} scans in {out} ({kept})")
        return
    sequence = simulation.simulate(scenario, sensor, scans, seed, compensated)
    with StageProgress(console, sequence.name) as progress:
        simulation.write(sequence, out, workers, progress)
    output.print(f"{len(sequence)} scans in {out}")


@app.command()
def drift(
    estimate: Annotated[Path, typer.Argument(help="poses.txt or poses.tum of a run")],
    reference: Annotated[Path, typer.Argument(help="reference poses of the same scans: KITTI or TUM")],
    calib: Annotated[Path | None, typer.Option(help="calib.txt with Tr:, if the reference is the camera's")] = None,
) -> None:
    """Score poses against a reference: absolute and relative errors, KITTI's t_err and r_err."""
    from automos.evaluation.drift_report import compare_trajectories

    output.print(compare_trajectories(estimate, reference, calib))


@app.command("settings")
def show_settings(preset: Preset = "default", settings: SettingsFile = None, set_: Overrides = None) -> None:
    """Print all settings as YAML; the output is a settings file."""
    from automos.settings import dump_yaml, load_settings, read_overrides

    output.print(dump_yaml(load_settings(preset, settings, read_overrides(set_))), end="")


def _print_version(wanted: bool) -> None:
    if wanted:
        from automos import __version__

        output.print(__version__)
        raise typer.Exit


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option(help="show tracebacks and log messages")] = False,
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="print the version")
    ] = False,
) -> None:
    logging.basicConfig(level=logging.DEBUG if debug else logging.ERROR, format="%(name)s: %(message)s")
    _Debug.on = debug


class _Debug:
    on = False


def main() -> None:
    """Run the command line; a user's mistake is one sentence and exit code 2."""
    try:
        app()
    except AutomosError as error:
        if _Debug.on:
            raise
        console.print(Text.assemble(("error: ", "red"), str(error)), soft_wrap=True)
        sys.exit(2)
    except SystemExit as leaving:
        if leaving.code == 130:  # what typer makes of Ctrl-C
            console.print("interrupted; the same command goes on from here", soft_wrap=True)
        raise
