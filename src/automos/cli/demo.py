"""The demo: simulate a street, label it, score the labels and draw them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from automos.core.array_sequence import ArraySequence
from automos.core.atomic import write_text
from automos.core.blas import one_blas_thread
from automos.core.claims import DEMO, claim
from automos.core.label_files import to_mos
from automos.core.run import Progress
from automos.core.scan import Scan, Sequence
from automos.evaluation.moving import Counts, Scores, count
from automos.objects.verdict import Verdict
from automos.odometry.trajectory import SequenceFrames
from automos.pipeline import Found, Steps
from automos.settings import Settings
from automos.simulation import SimulatedSequence, simulate
from automos.views.topdown import View, draw_views

SCENARIO, SENSOR, SCANS, SEED = "city", "HDL-64E", 30, 3
RADIUS = 45.0
"""Metres around the sensor that the picture shows."""


@dataclass(frozen=True)
class Demo:
    """What the demo made."""

    scores: Scores
    picture: Path
    report: Path


def run_demo(folder: Path, settings: Settings, progress: Progress) -> Demo:
    """Simulate a street, label it from its scans alone, and write a picture and a short report into `folder`.

    Raises
    ------
    InputError : the folder cannot be made.
    """
    claim(folder, DEMO)
    world = simulate(SCENARIO, SENSOR, SCANS, SEED)
    scans, truth = _record(world, progress)
    recording = ArraySequence(scans, world.stamps, name="street", is_compensated=world.is_compensated)
    result = Steps(recording, settings, progress=progress).found()
    counts = [count(result.labels(i), truth[i]) for i in range(SCANS)]
    scores = sum(counts[1:], counts[0]).scores

    picture, report = folder / "street.png", folder / "report.md"
    _draw(recording, result, truth, picture)
    write_text(report, _report(scores, counts, result))
    return Demo(scores, picture, report)


def _record(world: SimulatedSequence, progress: Progress) -> tuple[list[Scan], list[np.ndarray]]:
    scans, truth = [], []
    with one_blas_thread():
        for i in range(len(world)):
            scans.append(world[i])
            truth.append(to_mos(world.truth(i)))
            progress("simulation", i + 1, len(world))
    return scans, truth


def _draw(recording: Sequence, result: Found, truth: list[np.ndarray], picture: Path) -> None:
    frames = SequenceFrames(recording, result.trajectory)
    views = []
    for i in (SCANS // 3, 2 * SCANS // 3):
        frame = frames[i]
        views.append(View(f"scan {i}", frame.points_level, result.labels(i)[frame.kept], truth[i][frame.kept]))
    is_moving = result.verdicts.verdict == Verdict.MOVING
    tracks = [result.tracks.center[result.tracks.rows_of(k)] for k in np.flatnonzero(is_moving).tolist()]
    center = result.trajectory.T_level_sensor[SCANS // 2, :2, 3]
    draw_views(views, picture, center, RADIUS, tracks, columns=2)


def _report(scores: Scores, counts: list[Counts], result: Found) -> str:
    n_moving = int((result.verdicts.verdict == Verdict.MOVING).sum())
    stages = "\n".join(f"| {stage} | {seconds / SCANS:.3f} |" for stage, seconds in result.seconds.items())
    return f"""# A simulated street, labelled from its scans alone

{SCANS} scans of a {SENSOR} in scenario `{SCENARIO}`, seed {SEED}; poses, objects and labels found by AutoMOS.

| | |
|---|---|
| IoU of the moving class | {100 * scores.iou:.1f} % |
| precision | {100 * scores.precision:.1f} % |
| recall | {100 * scores.recall:.1f} % |
| objects found moving | {n_moving} |

`street.png` shows two scans from above: true moving points green, false moving red, missed blue, static grey.

| stage | seconds per scan |
|---|---|
{stages}
"""
