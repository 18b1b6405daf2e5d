"""Table I: every method on recordings with truth and on the scenario suite, from estimated poses.

    python benchmarks/table1.py [RECORDING ...] [--scenarios all | none | NAME ...] [--sensor HDL-64E] [--scans 40]
                                [--seed 0] [--methods ...] [--repeat 1] [--cache FOLDER] [--store FOLDER]
                                [--json FILE] [--markdown FILE]

With --store, worlds are those of benchmarks/gate.py, simulated where they are not there yet; without, they are whole
recordings in the cache folder. Labels and costs are kept there, too; a second run, or one after an interruption, makes
only what is missing or was made with other settings. Empty the folder after a change of the code. The first run after
an installation compiles kernels, and its seconds show it.
"""

from __future__ import annotations

import argparse
import json
from itertools import chain
from pathlib import Path

from rich.console import Console
from rich.table import Table
from store import stored_world
from suite import STATIC_WORLDS

from automos import open_sequence
from automos.baselines.comparison.compare import Comparison, compare, write_comparison
from automos.baselines.comparison.labelers import TITLES, choose_methods
from automos.baselines.comparison.runs import MethodRuns
from automos.core.progress import StageProgress
from automos.core.scan import Sequence
from automos.simulation import FORMAT, SCENARIOS, simulate, write


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--scenarios", nargs="+", default=["all"])
    parser.add_argument("--sensor", default="HDL-64E")
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--methods", nargs="+")
    parser.add_argument("--repeat", type=int, default=1, help="how often each method is timed on recordings")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "table1")
    parser.add_argument("--store", type=Path, help="where gate.py keeps its worlds")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path, help="the table of all recordings, for the docs")
    arguments = parser.parse_args()
    methods = choose_methods(arguments.methods)
    named = {"all": list(SCENARIOS), "none": []}.get(arguments.scenarios[0], arguments.scenarios)
    columns: dict[str, Comparison] = {}
    for sequence in chain(map(open_sequence, arguments.recordings), (_simulated(arguments, name) for name in named)):
        name = sequence.name.split(f"-{arguments.sensor}-")[0]
        is_real = name not in SCENARIOS
        runs = MethodRuns(
            sequence,
            arguments.cache / "runs" / sequence.name,
            own_process=is_real,
            repeats=arguments.repeat if is_real else 1,
        )
        columns[name] = compare(runs, methods)
        write_comparison(runs, columns[name])
        for table in columns[name].tables()[:1]:
            Console().print(table)
        if arguments.markdown:
            arguments.markdown.write_text(_markdown(columns, methods))
        if arguments.json:
            arguments.json.write_text(json.dumps({name: c.to_dict() for name, c in columns.items()}, indent=1))
    Console(width=240).print(_table(columns, methods))


def _simulated(arguments: argparse.Namespace, scenario: str) -> Sequence:
    if arguments.store is not None:
        return stored_world(arguments.store, scenario, arguments.sensor, arguments.scans, arguments.seed)
    folder = f"{scenario}-{arguments.sensor}-{arguments.scans}-{arguments.seed}-v{FORMAT}"
    recording = arguments.cache / folder
    recording.parent.mkdir(parents=True, exist_ok=True)
    with StageProgress(Console(stderr=True), folder) as progress:
        write(simulate(scenario, arguments.sensor, arguments.scans, arguments.seed), recording, 0, progress)
    return open_sequence(recording)


def _rows(columns: dict[str, Comparison], methods: list[str]) -> list[list[str]]:
    """Return the table's rows, its heading first."""
    worlds = [name for name in columns if name in SCENARIOS and name not in STATIC_WORLDS]
    rows = [["method", *columns, *(["mean of worlds"] if worlds else [])]]
    for method in methods:
        cells = [_cell(comparison, method, name) for name, comparison in columns.items()]
        ious = [columns[name].scores[method].iou for name in worlds if method in columns[name].scores]
        rows.append([TITLES[method], *cells, *([f"{100 * sum(ious) / len(ious):.1f}"] if ious else [])])
    return rows


def _table(columns: dict[str, Comparison], methods: list[str]) -> Table:
    heading, *rows = _rows(columns, methods)
    table = Table(*heading, title="IoU % of the moving class; (false points per scan) where nothing moves")
    for row in rows:
        table.add_row(*row)
    return table


def _markdown(columns: dict[str, Comparison], methods: list[str]) -> str:
    heading, *rows = _rows(columns, methods)
    lines = [heading, ["---", *["---:"] * (len(heading) - 1)], *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def _cell(comparison: Comparison, method: str, name: str) -> str:
    if method not in comparison.scores:
        return ""
    scores = comparison.scores[method]
    if name in STATIC_WORLDS:
        return f"({scores.false_dynamic / comparison.n_scans:.0f})"
    return f"{100 * scores.iou:.1f}"


if __name__ == "__main__":
    main()
