"""The maps without moving objects that each method's labels make of a recording with truth, by the usual metrics.

    python benchmarks/maps.py RECORDING --cache FOLDER [--methods ...] [--json FILE]

What `automos map RECORDING --method METHOD` says, for all methods. Labels are kept in FOLDER; a second run, or one
after an interruption, makes only what is missing. Empty the folder after a change of the code.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from rich.console import Console
from scores import finite

from automos import open_sequence
from automos.baselines.comparison.labelers import choose_methods
from automos.baselines.comparison.runs import MethodRuns
from automos.writers.maps.make_map import make_map, scores_by_name


def map_scores(runs: MethodRuns, method: str) -> dict[str, float | None]:
    """Return the scores of the map of `method`'s labels, by their usual names, None for what is not defined."""
    runs.cost(method)
    with tempfile.TemporaryDirectory() as folder:
        made = make_map(
            runs.frames,
            runs.sequence,
            lambda i, n: runs.labels(method, i, n) & 0xFFFF,
            Path(folder),
            [],
            runs.settings(method).map,
        )
    if made.scores is None:
        raise SystemExit(f"{runs.sequence.name} has no truth: no map of it can be scored")
    return finite(scores_by_name(made.scores))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--methods", nargs="+")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    sequence = open_sequence(arguments.recording)
    runs = MethodRuns(sequence, arguments.cache / sequence.name, own_process=False)
    found = {}
    for method in choose_methods(arguments.methods):
        found[method] = {"title": runs.title(method)} | map_scores(runs, method)
        Console().print(found[method])
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
