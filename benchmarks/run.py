"""The entry to all benchmarks: what there is, run one, write the tables of README and docs.

    python benchmarks/run.py --list
    python benchmarks/run.py gate                        print its table; a second run does only what is missing
    python benchmarks/run.py gate --save --against gate  beside the stored result of an earlier state; store this one
    python benchmarks/run.py ablation --recordings my_log/ city:VLP-16:60:7 --changes "" tracking.max_gap=0
    python benchmarks/run.py --write                     stored results into the tables of README and docs

Every experiment runs in a process of its own. Its result is a row with a head: commit and day, digest of the settings,
status, seconds, processor seconds and peak memory of the whole process. Results are kept in --store by the contents of
the package. Real recordings are those of the folder that AUTOMOS_RECORDINGS names (it holds `sequences/NAME`).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from ablation import cumulative
from catalog import BENCHMARKS, Benchmark
from experiment import commit, result_of
from rich.console import Console
from rich.table import Table
from rows import has_movers, is_still, mean_iou, sensor_of
from tables import RESULTS, calibrated, pages, read_results, shown, with_tables

from automos.core.atomic import write_text

NICE = 10
"""Priority that benchmarks take at most, lower being higher."""
WORST = 1.0
"""Points of IoU that an experiment may lose."""
MEAN = 0.05
"""Points that the mean of a sensor may lose."""
MORE = 1.03
"""How much more false points or cost there may be."""
HERE = Path(__file__).parent
Row = dict[str, Any]


def run(name: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the result of a benchmark: its rows, and what made them."""
    benchmark = BENCHMARKS[name]
    made_by = " ".join(["python benchmarks/run.py", *sys.argv[1:]])
    result: dict[str, Any] = {"made_by": made_by, "leaves_out": benchmark.leaves_out}
    if benchmark.measure.endswith(".py"):
        return result | {"rows": _of_script(benchmark, arguments)}
    asked = vars(arguments) | {"quick": arguments.quick}
    if arguments.cumulative:
        asked["changes"] = ["", *cumulative(arguments.changes)]
    experiments, rows = benchmark.experiments(**asked), []
    with ThreadPoolExecutor(1 if benchmark.is_timed else arguments.at_once) as pool:
        done = pool.map(lambda each: result_of(each, arguments.store, arguments.again), experiments)
        for n, (experiment, row) in enumerate(zip(experiments, done, strict=True), 1):
            said = f"{n}/{len(experiments)} {experiment}: {row['head']['status']}"
            iou = "" if row.get("iou") is None else f", IoU {100 * row['iou']:.1f}"
            Console(stderr=True).print(said + iou, markup=False, highlight=False, soft_wrap=True)
            rows.append(row)
    return calibrated(result | {"rows": rows})


def _of_script(benchmark: Benchmark, arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the rows that a script of this folder stores, each with what is known of its making."""
    given = benchmark.options["arguments"] + (benchmark.options["quick"] if arguments.quick else ())
    places = {"STORE": arguments.store, "kitti_0005": _recording("kitti_0005")}
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "rows.json"
        words = [str(places.get(word, word)) for word in given]
        subprocess.run([sys.executable, HERE / benchmark.measure, *words, "--json", report], check=True)
        rows = json.loads(report.read_text())
    head = {"commit": commit(), "date": datetime.now(UTC).date().isoformat(), "status": "done"}
    return [{**row, "head": head} for row in rows]


def _recording(name: str) -> Path:
    return Path(os.environ.get("AUTOMOS_RECORDINGS", "recordings")) / "sequences" / name


def show(name: str, result: dict[str, Any], against: Path | None) -> None:
    """Print the tables that a benchmark's result makes, and what got worse since an earlier one."""
    console = Console(width=150)
    for title, (heading, *rows) in shown(name, result):
        table = Table(*heading, title=title)
        for cells in rows:
            table.add_row(*cells)
        console.print(table)
    for row in result["rows"]:
        if row["head"]["status"] != "done":
            console.print(f"{row.get('recording', '')} {row['head']['status']}", style="red", markup=False)
    if against is not None:
        for line in verdicts(result["rows"], json.loads(against.read_text())["rows"]):
            console.print(line)


def verdicts(rows: list[Row], before: list[Row]) -> list[str]:
    """Return what got worse: a sensor's mean, an experiment by more than WORST, false points, cost."""
    was = {_key(row): row for row in before if row["head"]["status"] == "done"}
    both = [row for row in rows if row["head"]["status"] == "done" and _key(row) in was]
    if not both:
        return ["nothing to compare with"]
    said, old = [], [was[_key(row)] for row in both]
    for sensor in dict.fromkeys(map(sensor_of, both)):
        a, b = (mean_iou([row for row in some if sensor_of(row) == sensor]) for some in (both, old))
        if a < b - MEAN / 100.0:
            said.append(f"mean of {sensor or 'recordings'} fell from {100 * b:.1f} to {100 * a:.1f}")
    for new, one in zip(both, old, strict=True):
        if has_movers(new) and 100.0 * (new["iou"] - one["iou"]) < -WORST:
            said.append(f"{new['recording']} fell from {100 * one['iou']:.1f} to {100 * new['iou']:.1f}")
    for name, of in _GROWING.items():
        if of(both) > MORE * of(old):
            said.append(f"{name} grew from {of(old):,.4g} to {of(both):,.4g}")
    return [f"[red]worse: {line}" for line in said] or [f"[green]nothing is worse in {len(both)} experiments"]


def merged(result: dict[str, Any], before: dict[str, Any], varied: Iterable[str] = ()) -> dict[str, Any]:
    """Return a stored result in which what was done anew, a part of it, has replaced its like or is added."""
    kept = {_key(row, varied): row for row in before["rows"]}
    kept |= {_key(row, varied): row for row in result["rows"] if row["head"]["status"] == "done"}
    return {**result, **before, "rows": list(kept.values())}


def _key(row: Row, varied: Iterable[str] = ()) -> tuple[str, ...]:
    return tuple(str(row.get(name) or "") for name in ("recording", "method", "change", *varied))


_GROWING: dict[str, Callable[[list[Row]], float]] = {
    "points called moving where nothing moves": lambda rows: sum(r["called_moving"] for r in rows if is_still(r)),
    "processor seconds a scan": lambda rows: sum(r["cpu_seconds"] for r in rows) / sum(r["scans"] for r in rows),
    "peak MB": lambda rows: float(np.max([row["peak_mb"] or 0.0 for row in rows])),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="; ".join(BENCHMARKS))
    parser.add_argument("--recordings", nargs="+", help="others (benchmarks/recordings.py says how they are named)")
    parser.add_argument("--methods", nargs="+", help="others: presets, published methods where they are compared")
    parser.add_argument("--changes", nargs="+", help="others (benchmarks/ablation.py says how they are written)")
    parser.add_argument("--cumulative", action="store_true", help="each change with all before it")
    parser.add_argument("--seeds", nargs="+", type=int, help="of simulated worlds, others")
    parser.add_argument("--store", type=Path, default=Path.home() / ".cache" / "automos" / "benchmarks")
    parser.add_argument("--quick", action="store_true", help="the short form")
    parser.add_argument("--again", action="store_true", help="do again what is kept")
    parser.add_argument("--at-once", type=int, default=1, help="experiments side by side, unless they are timed")
    parser.add_argument("--against", help="stored result to compare with: its name, or a file")
    parser.add_argument(
        "--save", action="store_true", help="store the result, or the part that was run, for README and docs"
    )
    parser.add_argument("--list", action="store_true", help="what there is")
    parser.add_argument("--write", action="store_true", help="write stored results into README and docs")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"there is no benchmark {', '.join(unknown)}; known are {', '.join(BENCHMARKS)}")
    if arguments.list:
        for name, benchmark in BENCHMARKS.items():
            print(f"{name:18} {benchmark.what} ({benchmark.takes})")
    os.nice(max(0, NICE - os.nice(0)))
    for name in arguments.names:
        result = run(name, arguments)
        stored = RESULTS / f"{name}.json"
        against = None
        if arguments.against:
            against = Path(arguments.against)
            against = against if against.exists() else RESULTS / f"{arguments.against}.json"
        show(name, result, against)
        if arguments.save:
            asked = (arguments.recordings, arguments.methods, arguments.changes, arguments.seeds, arguments.quick)
            before = json.loads(stored.read_text()) if any(asked) and stored.exists() else {"rows": []}
            write_text(stored, as_text(merged(result, before, BENCHMARKS[name].varied)))
    if arguments.write:
        results = read_results()
        for page in pages():
            page.write_text(with_tables(page.read_text(), results))


def as_text(result: dict[str, Any]) -> str:
    """Return `result` as JSON of one row a line, so that results can be read and compared as text."""
    rows = ",\n".join(f"  {json.dumps(row)}" for row in result["rows"])
    return json.dumps({**result, "rows": 0}, indent=1).replace('"rows": 0', f'"rows": [\n{rows}\n ]') + "\n"


if __name__ == "__main__":
    main()
