"""The commands `check`, `evaluate`, `drift`: whether a recording can be labelled; scores against ground truth."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from automos.cli.options import Format, Recording, app, output


@app.command()
def check(
    recording: Recording,
    format: Format = None,
    as_json: Annotated[bool, typer.Option("--json", help="print all that was found as JSON")] = False,
) -> None:
    """Say what a recording is, what will be assumed of it, and whether it can be labelled; make no labels.

    It reads headers and at most 20 scans. The exit code is 0, 1 where there are doubts, 2 where it cannot be labelled.

    [bold]Examples[/bold]

    automos check my_log/

    automos check my_log/ --columns x,y,z,intensity,ring,time

    automos check drive.bag --json
    """
    from automos.core.errors import AutomosError, plain
    from automos.fleet.sources import find_all
    from automos.views.checking import check as check_recordings

    found = check_recordings(recording, format)
    with suppress(AutomosError):  # found has it
        if found[0].error and len(several := find_all(str(recording), format)) > 1:  # as `label` takes them
            found = [each for one in several for each in check_recordings(one.source, one.format)]
    if as_json:
        output.print(json.dumps([one.to_dict() for one in found], indent=1), markup=False, soft_wrap=True)
    else:
        for one in found:
            output.print(plain("\n".join(one.lines())), markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(max(one.exit_code for one in found))


@app.command()
def evaluate(
    predictions: Annotated[Path, typer.Argument(help="a results folder, or a folder of .label files")],
    recording: Recording,
    format: Format = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="write the scores here")] = None,
) -> None:
    """Score labels against the ground truth of a recording: points, as SemanticKITTI's moving-object benchmark does.

    Then, where truth and labels name objects: movers whole, missed, split or merged, tracks, and boxes.
    """
    from automos.core.atomic import write_text
    from automos.core.claims import SIGN, claim_file
    from automos.evaluation.boxes import objects_table
    from automos.evaluation.report import evaluate_recordings
    from automos.readers import open_recordings
    from automos.results.box_scores import score_boxes
    from automos.writers.flow import score_flow

    recordings = open_recordings(recording, format)
    if json_file is not None:
        claim_file(json_file)
    report, flow = evaluate_recordings(predictions, recordings), score_flow(predictions, recordings)
    boxes = score_boxes(
        predictions, {s: report.recordings[s.name].overlaps for s in recordings if s.name in report.recordings}
    )
    output.print(report.table())
    if report.objects is not None:
        output.print(objects_table(report.objects, boxes))
    if flow is not None:
        output.print(flow.table())
    if json_file is not None:
        scores = {"comment": SIGN.decode(), **report.to_dict()}
        scores |= {name: more.to_dict() for name, more in (("boxes", boxes), ("flow", flow)) if more is not None}
        write_text(json_file, json.dumps(scores, indent=2, allow_nan=False) + "\n")


@app.command()
def drift(
    estimate: Annotated[Path, typer.Argument(help="poses.txt or poses.tum of a run")],
    reference: Annotated[Path, typer.Argument(help="reference poses of the same scans: KITTI or TUM")],
    calib: Annotated[Path | None, typer.Option(help="calib.txt with Tr:, if the reference is the camera's")] = None,
) -> None:
    """Score poses against a reference: absolute and relative errors, KITTI's t_err and r_err."""
    from automos.evaluation.trajectory import compare_trajectories

    output.print(compare_trajectories(estimate, reference, calib))
