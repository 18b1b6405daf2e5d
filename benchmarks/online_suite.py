"""The method as scans come over the scenario suite: IoU of every scan, the first ones too, at some lags.

    python benchmarks/online_suite.py --store FOLDER [--seeds 100] [--scenarios ...] [--sensors ...] [--lags 0 0.5]
                                      [--scans 60] [--scored-only] [--json FILE]

Worlds are those of the gate, simulated into FOLDER where they are not there yet. Rows are kept by the contents of the
installed package, so a second run, or one after an interruption, labels only what is missing. Milliseconds a scan are
processor time of all threads, the first scans left out, so that other work on the machine disturbs them little.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from experiment import code_digest
from recordings import StoredWorld, stored_world
from rich.console import Console
from rich.table import Table
from rows import has_movers, percent

from automos import Labeler
from automos.core.atomic import write_text
from automos.evaluation.moving import Counts, count
from automos.live.segment import stamped
from automos.simulation import LONG, SCENARIOS

SENSORS = ("HDL-64E", "OS1-128", "VLP-16")
WARM_UP = 12
"""Scans whose times do not count."""


def measure(world: StoredWorld, lag: float) -> dict[str, float]:
    """Return scores and processor milliseconds a scan of one world at a lag."""
    labeler, counts, milliseconds = Labeler(lag=lag, is_compensated=world.is_compensated), Counts(), []
    given = []
    for scan in stamped(world):
        start = time.process_time()
        given += labeler.push(scan)
        milliseconds.append(1e3 * (time.process_time() - start))
    for done in given + labeler.finish():
        counts += count(done.labels, world.truth(done.index))
    found, usual = counts.scores, milliseconds[WARM_UP:]
    return {
        "iou": found.iou,
        "precision": found.precision,
        "recall": found.recall,
        "true_points": found.true_dynamic,
        "false_points": found.false_dynamic,
        "missed_points": found.false_static,
        "points": found.n_points,
        "median_cpu_ms": float(np.median(usual)),
        "p99_cpu_ms": float(np.percentile(usual, 99)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[100])
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=[s for s in SCENARIOS if s not in LONG])
    parser.add_argument("--sensors", nargs="+", default=list(SENSORS))
    parser.add_argument("--lags", nargs="+", type=float, default=[0.0, 0.5])
    parser.add_argument("--scans", type=int, default=60)
    parser.add_argument("--scored-only", action="store_true", help="label nothing: show what is there")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    folder, rows = arguments.store / "scores" / f"{code_digest()}-online", {}
    folder.mkdir(parents=True, exist_ok=True)
    cells = [(s, c, r, lag) for s in arguments.seeds for c in arguments.scenarios for r in arguments.sensors
             for lag in arguments.lags]  # fmt: skip
    for seed, scenario, sensor, lag in cells:
        file = folder / f"{scenario}-{sensor}-{arguments.scans}-{seed}-{lag:g}.json"
        if not file.exists() and not arguments.scored_only:
            row = measure(stored_world(arguments.store, scenario, sensor, arguments.scans, seed), lag)
            Console(stderr=True).print(f"{seed} {scenario} {sensor} lag {lag:g}: {100 * row['iou']:.1f}")
            write_text(file, json.dumps(row))
        if file.exists():
            rows[seed, scenario, sensor, lag] = json.loads(file.read_text())
    Console(width=140).print(_table(rows, arguments))
    if arguments.json:
        arguments.json.write_text(json.dumps([{"cell": list(cell), **row} for cell, row in rows.items()], indent=1))


def _table(rows: dict, arguments: argparse.Namespace) -> Table:
    columns = [(sensor, lag) for sensor in arguments.sensors for lag in arguments.lags]
    table = Table(
        "seed", "scenario", *(f"{sensor}, {lag:g} s" for sensor, lag in columns), title="IoU % (prec./recall)"
    )
    for seed in arguments.seeds:
        for scenario in arguments.scenarios:
            cells = [rows.get((seed, scenario, *column)) for column in columns]
            if any(cells):
                table.add_row(str(seed), scenario, *("" if row is None else cell_text(row) for row in cells))
    table.add_section()
    for name, of, scale in (
        ("mean", "iou", 100.0),
        ("CPU ms, median", "median_cpu_ms", 1.0),
        ("p99", "p99_cpu_ms", 1.0),
    ):
        found = [
            [row[of] for (_, _, *column), row in rows.items()
             if tuple(column) == wanted and (of != "iou" or has_movers(row))]
            for wanted in columns
        ]  # fmt: skip
        table.add_row("", name, *(f"{scale * np.mean(of_column):.1f}" if of_column else "" for of_column in found))
    return table


def cell_text(row: dict[str, float]) -> str:
    """Return what a table says of a world: its scores, or its false points where nothing moves."""
    if not has_movers(row):
        return f"{row['false_points']} false of {row['points']:,}"
    return " / ".join(percent(row[key]) for key in ("iou", "precision", "recall"))


if __name__ == "__main__":
    main()
