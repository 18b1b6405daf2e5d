"""Table I of the paper: every method on SemanticKITTI's training sequences 00-07, 09, 10, beside the paper's figures.

    python benchmarks/semantickitti.py DATASET [--sequences 00 01 ...] [--methods ...] [--cache FOLDER] [--json FILE]

DATASET holds `sequences/00/{velodyne,labels,times.txt,...}`. Poses are estimated from the scans, one set for all.
What a method found is kept scan by scan; after an interruption the same command goes on with the next method. Points of
all sequences are pooled, as the benchmark counts them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

from automos import open_sequence
from automos.baselines.comparison.compare import Comparison, compare, write_comparison
from automos.baselines.comparison.labelers import TITLES, choose_methods
from automos.baselines.comparison.runs import MethodRuns
from automos.core.progress import StageProgress
from automos.evaluation.moving import Scores

SEQUENCES = ("00", "01", "02", "03", "04", "05", "06", "07", "09", "10")
PAPER = {"octomap": 13.6, "removert": 15.7, "erasor": 19.1, "pfreundschuh": 34.5, "yoon": 15.1, "paper": 74.2}
"""IoU % that Chen et al. report (Table I)."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--sequences", nargs="+", default=list(SEQUENCES))
    parser.add_argument("--methods", nargs="+")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "semantickitti")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    methods = choose_methods(arguments.methods)
    done: dict[str, Comparison] = {}
    for name in arguments.sequences:
        sequence = open_sequence(arguments.dataset / "sequences" / name)
        with StageProgress(Console(stderr=True), name) as progress:
            runs = MethodRuns(sequence, arguments.cache / name, progress=progress)
            done[name] = compare(runs, methods)
        write_comparison(runs, done[name])
        Console().print(_table(done, methods))
        if arguments.json:
            arguments.json.write_text(json.dumps({name: c.to_dict() for name, c in done.items()}, indent=1))


def _table(done: dict[str, Comparison], methods: list[str]) -> Table:
    table = Table(title=f"IoU % of the moving class, sequences {', '.join(done)}")
    for heading in ("method", *done, "all points", "paper", "s/scan", "peak MB"):
        table.add_column(heading, justify="left" if heading == "method" else "right")
    for method in methods:
        found = [comparison for comparison in done.values() if method in comparison.scores]
        if not found:
            continue
        n_scans = sum(comparison.n_scans for comparison in found)
        seconds = sum(c.costs[method].seconds_per_scan * c.n_scans for c in found) / n_scans
        table.add_row(
            TITLES[method],
            *(f"{100 * c.scores[method].iou:.1f}" if method in c.scores else "" for c in done.values()),
            f"{100 * _pooled([c.scores[method] for c in found]).iou:.1f}",
            str(PAPER.get(method, "")),
            f"{seconds:.2f}",
            f"{max(c.costs[method].peak_memory for c in found) / 1e6:.0f}",
        )
    return table


def _pooled(parts: list[Scores]) -> Scores:
    names = ("true_dynamic", "false_dynamic", "false_static", "n_points", "n_unlabeled")
    return Scores(**{name: sum(getattr(part, name) for part in parts) for name in names})


if __name__ == "__main__":
    main()
