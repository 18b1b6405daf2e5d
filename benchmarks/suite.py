"""Label quality over the scenario suite: every scenario x sensor, poses estimated, nothing changed between worlds.

    python benchmarks/suite.py [--presets paper default] [--sensors HDL-64E OS1-128 VLP-16] [--scenarios ...]
                               [--scans 100] [--seed 0] [--cache FOLDER] [--json FILE]

Simulated recordings and scores are kept in the cache folder; a second run, or one after an interruption, computes only
what is missing or was made with other settings. Empty the folder's `scores` after a change of the code.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table
from speed import MemoryWatch, cpu_seconds

from automos import Workspace, label, load_settings, open_sequence
from automos.core.atomic import write_text
from automos.core.labels import OUTLIER, Label, to_mos
from automos.core.progress import StageProgress
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts, count
from automos.pipeline import stage_keys
from automos.simulation import FORMAT, SCENARIOS, simulate, write

STATIC_WORLDS = ("country",)
"""Scenarios in which nothing moves: the share of false points counts, IoU has no meaning."""
N_BINS = 20
"""Steps of confidence by which points are counted."""


def measure(
    sequence: Sequence,
    preset: str,
    run: Path,
    workers: int,
    progress: StageProgress,
    bodies: Callable[[int], npt.NDArray[np.bool_]] | None = None,
) -> dict:
    """Return points right and wrong, calibration, seconds and memory of one preset on one recording.

    `run` is a folder for what is kept meanwhile. Seconds are of processors, this process's and its children's.
    `bodies(i)` tells which points of scan i are on what carries the sensor, where that should be counted.
    """
    settings = load_settings(preset)
    watch, cpu, start = MemoryWatch(), cpu_seconds(), time.perf_counter()
    watch.start()
    try:
        result = label(sequence, settings, workspace=Workspace(run), workers=workers, progress=progress)
        seconds = {"cpu_seconds": cpu_seconds() - cpu, "wall_seconds": time.perf_counter() - start}
        watch.finish()
        counts, reliability, moving, total = Counts(), np.zeros((2, N_BINS, 3)), 0, 0
        body_points = body_moving = air_points = air_moving = 0
        for i in range(len(sequence)):
            labels, truth = result.labels(i), sequence.truth(i)
            moving, total = moving + int(np.count_nonzero(labels == Label.MOVING)), total + len(labels)
            if bodies is not None:
                body = bodies(i)
                body_points += int(np.count_nonzero(body))
                body_moving += int(np.count_nonzero(labels[body] == Label.MOVING))
            if truth is not None:
                in_air = truth & 0xFFFF == OUTLIER
                air_points += int(np.count_nonzero(in_air))
                air_moving += int(np.count_nonzero(labels[in_air] == Label.MOVING))
                counts += count(labels, truth)
                reliability += _reliability(labels, truth, result.confidence(i))
    finally:
        shutil.rmtree(run, ignore_errors=True)
    found = counts.scores
    return {
        "iou": found.iou,
        "precision": found.precision,
        "recall": found.recall,
        "true_points": found.true_dynamic,
        "false_points": found.false_dynamic,
        "missed_points": found.false_static,
        "points": found.n_points,
        "called_moving": moving,
        "percent_moving": 100.0 * moving / max(total, 1),
        "body_points": body_points,
        "body_moving": body_moving,
        "air_points": air_points,
        "air_moving": air_moving,
        "scans": len(sequence),
        **seconds,
        "peak_mb": max(watch.peak.values()) / 1e6 if watch.peak else None,
        "reliability": reliability.round(3).tolist(),
    }


def _reliability(labels: npt.NDArray, truth: npt.NDArray, confidence: npt.NDArray) -> npt.NDArray[np.float64]:
    """Return (2, N_BINS, 3): of points called static and moving, by confidence: how many, confidence's sum, right."""
    true = to_mos(truth)
    out = np.zeros((2, N_BINS, 3))
    for k, kind in enumerate((Label.STATIC, Label.MOVING)):
        rows = (labels == kind) & ((true == Label.STATIC) | (true == Label.MOVING))
        bins = np.minimum((confidence[rows] * N_BINS).astype(int), N_BINS - 1)
        for j, weight in enumerate((None, confidence[rows], true[rows] == kind)):
            out[k, :, j] = np.bincount(bins, weight, N_BINS)
    return out


def calibration_error(reliability: npt.ArrayLike) -> float:
    """Return the expected calibration error of (N_BINS, 3) points, confidence's sum and points right, nan of none."""
    n, confidence, right = np.asarray(reliability).T
    return float(np.abs(confidence - right).sum() / n.sum()) if n.sum() else float("nan")


def score(recording: Path, preset: str, cache: Path, progress: StageProgress) -> dict:
    """Return what `measure` does, kept for the same recording and settings."""
    sequence, settings = open_sequence(recording), load_settings(preset)
    key = stage_keys(sequence, settings)["labels"]
    result_file = cache / "scores" / f"{recording.name}-{preset}-{key}.json"
    if not result_file.exists():
        row = measure(sequence, preset, cache / "runs" / result_file.stem, 0, progress)
        result_file.parent.mkdir(exist_ok=True)
        write_text(result_file, json.dumps(row))
    return json.loads(result_file.read_text())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presets", nargs="+", default=["paper", "default"])
    parser.add_argument("--sensors", nargs="+", default=["HDL-64E", "OS1-128", "VLP-16"])
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--scans", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "suite")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    arguments.cache.mkdir(parents=True, exist_ok=True)
    cells = {}
    for scenario in arguments.scenarios:
        for sensor in arguments.sensors:
            recording = arguments.cache / f"{scenario}-{sensor}-{arguments.scans}-{arguments.seed}-v{FORMAT}"
            world = simulate(scenario, sensor, arguments.scans, arguments.seed)
            with StageProgress(Console(stderr=True), recording.name) as progress:
                write(world, recording, 0, progress)
                for preset in arguments.presets:
                    cells[scenario, sensor, preset] = score(recording, preset, arguments.cache, progress)
    for preset in arguments.presets:
        Console().print(_table(cells, arguments, preset))
    if arguments.json:
        arguments.json.write_text(json.dumps([{"cell": list(k), **v} for k, v in cells.items()], indent=1))


def _table(cells: dict, arguments: argparse.Namespace, preset: str) -> Table:
    table = Table("scenario", *arguments.sensors, title=f"preset {preset}: IoU % (precision / recall)")
    for scenario in arguments.scenarios:
        table.add_row(scenario, *(cell_text(cells[scenario, s, preset], scenario) for s in arguments.sensors))
    means = []
    for sensor in arguments.sensors:
        ious = [cells[c, sensor, preset]["iou"] for c in arguments.scenarios if c not in STATIC_WORLDS]
        means.append(f"{100 * sum(ious) / len(ious):.1f}" if ious else "")
    table.add_section()
    table.add_row("mean", *means)
    return table


def cell_text(row: dict, scenario: str) -> str:
    """Return what a table says of a world: its scores, or its false points where nothing moves."""
    if scenario in STATIC_WORLDS:
        return f"{row['false_points']} false of {row['points']:,}"
    return f"{100 * row['iou']:5.1f} ({100 * row['precision']:.0f} / {100 * row['recall']:.0f})"


if __name__ == "__main__":
    main()
