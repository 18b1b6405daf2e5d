"""Sensors that the gate does not have, on simulated drives: labels, the choice of the timing, and the path.

    python benchmarks/other_sensors.py [--sensors Avia ...] [--scenarios city ...] [--seeds 104 105] [--scans 40]
                                       [--json FILE]

All sweeps are raw, without times of their points in the files; those of the Avia, which does not turn, also with times.
The path is off by the difference between its estimated and its true length.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import product
from pathlib import Path

import numpy as np
from lines import show_lines
from rich.console import Console
from scores import finite

from automos import Workspace, label, open_sequence
from automos.core.progress import StageProgress
from automos.evaluation.moving import Counts, count
from automos.evaluation.trajectory import path_length
from automos.simulation import SCENARIOS, SENSORS, Convention, record, write_recorded

OTHERS = ("HDL-32E", "OS1-64", "VLS-128", "Avia")
DRIVES = ("city", "junction", "campus", "avenue", "hills", "scooters")


def examine(scenario: str, sensor: str, times: str, seed: int, n_scans: int, progress: StageProgress) -> dict:
    """Return the scores of one drive, whether its sweeps are taken for raw, and by how much its path is off."""
    made = record(scenario, sensor, n_scans, seed, convention=Convention.parse((f"times={times}",)))
    with tempfile.TemporaryDirectory() as folder:
        recording = open_sequence(write_recorded(made, Path(folder) / "recording"))
        result = label(recording, workspace=Workspace(Path(folder) / "stages"), progress=progress)
        counts = sum((count(result.labels(i), recording.truth(i)) for i in range(len(recording))), Counts())
    way, true = (float(path_length(poses)[-1]) for poses in (result.trajectory.T_world_sensor, made.reference_poses))
    return finite({
        "iou": counts.scores.iou,
        "false": float(counts.scores.false_dynamic),
        "off": abs(way - true) / true if true > 1.0 else np.nan,
        "is_timed": float(result.trajectory.timing.source != "none"),
    })  # fmt: skip


def summary(rows: list[dict]) -> list[str]:
    """Return the cells of one sensor's drives."""
    scores, paths = ([row[key] for row in rows if row[key] is not None] for key in ("iou", "off"))
    return [
        f"{100 * np.mean(scores):.1f}",
        f"{100 * np.min(scores):.1f}",
        f"{sum(row['false'] for row in rows):,.0f}",
        f"{100 * np.mean(paths):.2f} %",
        f"{sum(row['is_timed'] for row in rows):.0f} of {len(rows)}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sensors", nargs="+", choices=SENSORS, default=list(OTHERS))
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=list(DRIVES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[104, 105])
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    heading = ["sensor", "times in the files", "mean IoU", "worst", "false points", "path off", "sweeps taken for raw"]
    lines = [heading]
    for sensor in arguments.sensors:
        for times in ("none", "relative") if sensor == "Avia" else ("none",):
            rows = []
            for seed, scenario in product(arguments.seeds, arguments.scenarios):
                with StageProgress(Console(stderr=True), f"{scenario} {sensor} {seed}") as progress:
                    rows.append(examine(scenario, sensor, times, seed, arguments.scans, progress))
                print(f"{scenario} {sensor} {times} {seed}: {rows[-1]}", flush=True)
            lines.append([sensor, "yes" if times == "relative" else "no", *summary(rows)])
    show_lines(lines, arguments.json)


if __name__ == "__main__":
    main()
