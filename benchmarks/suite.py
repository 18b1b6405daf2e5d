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
from pathlib import Path

from rich.console import Console
from rich.table import Table

from automos import Workspace, label, load_settings, open_sequence
from automos.atomic import write_text
from automos.evaluation.moving import Counts, count
from automos.pipeline import stage_keys
from automos.progress import StageProgress
from automos.simulation import FORMAT, SCENARIOS, simulate, write

STATIC_WORLDS = ("country",)
"""Scenarios in which nothing moves: the share of false points counts, IoU has no meaning."""


def score(recording: Path, preset: str, cache: Path, progress: StageProgress) -> dict:
    """Return IoU, precision and recall of one preset on one recording."""
    sequence, settings = open_sequence(recording), load_settings(preset)
    key = stage_keys(sequence, settings)["labels"]
    result_file = cache / "scores" / f"{recording.name}-{preset}-{key}.json"
    if not result_file.exists():
        run = cache / "runs" / result_file.stem
        result = label(sequence, settings, workspace=Workspace(run), progress=progress)
        counts = sum((count(result.labels(i), sequence.truth(i)) for i in range(len(sequence))), Counts())
        found = counts.scores
        row = {
            "iou": found.iou,
            "precision": found.precision,
            "recall": found.recall,
            "false_points": found.false_dynamic,
            "points": found.n_points,
        }
        result_file.parent.mkdir(exist_ok=True)
        write_text(result_file, json.dumps(row))
        shutil.rmtree(run)
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
        table.add_row(scenario, *(_cell(cells[scenario, s, preset], scenario) for s in arguments.sensors))
    means = []
    for sensor in arguments.sensors:
        ious = [cells[c, sensor, preset]["iou"] for c in arguments.scenarios if c not in STATIC_WORLDS]
        means.append(f"{100 * sum(ious) / len(ious):.1f}" if ious else "")
    table.add_section()
    table.add_row("mean", *means)
    return table


def _cell(row: dict, scenario: str) -> str:
    if scenario in STATIC_WORLDS:
        return f"{row['false_points']} false of {row['points']:,}"
    return f"{100 * row['iou']:5.1f} ({100 * row['precision']:.0f} / {100 * row['recall']:.0f})"


if __name__ == "__main__":
    main()
