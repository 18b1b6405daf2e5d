"""The commands that score labels and poses against a truth: parse, call one function, print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from automos.cli.consoles import output
from automos.cli.options import Format, Recording

score_app = typer.Typer()


@score_app.command()
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


@score_app.command()
def drift(
    estimate: Annotated[Path, typer.Argument(help="poses.txt or poses.tum of a run")],
    reference: Annotated[Path, typer.Argument(help="reference poses of the same scans: KITTI or TUM")],
    calib: Annotated[Path | None, typer.Option(help="calib.txt with Tr:, if the reference is the camera's")] = None,
) -> None:
    """Score poses against a reference: absolute and relative errors, KITTI's t_err and r_err."""
    from automos.evaluation.drift_report import compare_trajectories

    output.print(compare_trajectories(estimate, reference, calib))
