"""The tables of README and docs: which benchmark makes each, and how its stored result is written there.

A table stands between `<!-- table NAME -->` and `<!-- end -->`, below it the command, the commit and the day.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bodies
import numpy as np
import rows as make
from catalog import PRESETS
from labels import calibration_error
from rows import Lines, Row, sensor_of

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"
MARK = re.compile(r"(?P<head><!-- table (?P<name>[\w-]+) -->\n)(?P<shown>.*?)(?P<end><!-- end -->)", re.DOTALL)
Result = dict[str, Any]


@dataclass(frozen=True)
class Table:
    """What a table shows.

    Attributes
    ----------
    benchmark, make : whose result, and what makes lines of its rows.
    methods : the rows of these methods only.
    select : which lines are shown of a result that was stored as lines.
    has_calibration : whether `make` takes the calibration errors, too.
    """

    benchmark: str
    make: Callable[..., Lines]
    methods: tuple[str, ...] = ()
    select: Callable[[Lines], Lines] = list
    has_calibration: bool = False

    def rows(self, result: Result) -> list[Row]:
        """Return the rows that are shown."""
        done = [row for row in result["rows"] if row["head"]["status"] == "done"]
        return [row for row in done if not self.methods or row.get("method") in self.methods]

    def lines(self, result: Result) -> Lines:
        """Return heading and lines; an early result may have been stored as such."""
        if "lines" in result:
            return self.select(result["lines"])
        more = [result.get("calibration")] if self.has_calibration else []
        return self.make(self.rows(result), *more)


TABLES = {
    "presets-worlds": Table("methods-worlds", make.methods_of_worlds, PRESETS),
    "presets-drive": Table("methods-drive", make.presets, PRESETS),
    "methods-worlds": Table("methods-worlds", make.methods_of_worlds),
    "methods-drive": Table("methods-drive", make.methods_of_drive),
    "rivals": Table("rivals", make.rivals),
    "gate": Table("gate", make.gate, has_calibration=True),
    "objects": Table("objects", bodies.objects),
    "calibration": Table("calibration", bodies.calibration),
    "recordings": Table("recordings", make.recordings),
    "jitter": Table("jitter", make.jitter),
    "conventions": Table("conventions", make.conventions, select=make.notable_conventions),
    "other-sensors": Table("other-sensors", make.other_sensors, select=make.scores_of_sensors),
    "robustness": Table("robustness", make.robustness),
    "ablation": Table("ablation", make.ablation, select=make.notable_changes),
    "ablation-odometry": Table("ablation-odometry", make.ablation_odometry),
    "odometry": Table("odometry", make.drift),
    "trust": Table("trust", make.trust),
    "stages": Table("stages", make.stages),
    "odometry-speed": Table("odometry-speed", make.odometry_speed),
    "online": Table("online", make.online),
    "lags": Table("lags", make.lags),
    "table-2": Table("table-2", make.networks),
    "table-3": Table("table-3", make.networks),
    "fine-tuning": Table("table-3", make.fine_tuning),
    "labels-of-networks": Table("labels-of-networks", make.labels_of_networks),
    "shipped-network": Table("shipped-network", make.shipped_network),
    "network-speed": Table("network-speed", make.network_speed),
    "fleet": Table("fleet", make.fleet),
}


def pages() -> list[Path]:
    """Return README and all pages of the docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def read_results() -> dict[str, Result]:
    """Return the stored results by benchmark."""
    return {file.stem: json.loads(file.read_text()) for file in sorted(RESULTS.glob("*.json"))}


def calibrated(result: Result) -> Result:
    """Return a result with the calibration errors of each sensor in place of what they are computed from."""
    found: dict[str, Any] = {}
    for row in result["rows"]:
        if (reliability := row.pop("reliability", None)) is not None and "iou" in row:
            found[sensor_of(row)] = found.get(sensor_of(row), 0.0) + np.array(reliability)
    errors = {sensor: [calibration_error(kind) for kind in both] for sensor, both in found.items() if sensor}
    return result | ({"calibration": errors} if errors else {})


def shown(benchmark: str, result: Result) -> Iterator[tuple[str, Lines]]:
    """Yield name and lines of the tables that a result makes; one row a recording where there is none for it."""
    rows = [row for row in result["rows"] if row["head"]["status"] == "done"]
    for name, table in TABLES.items():
        if table.benchmark == benchmark and table.rows(result):
            try:
                if len(lines := table.lines(result)) > 1:
                    yield name, lines
            except (KeyError, StopIteration, ValueError):  # parts of it, or other recordings than it is about
                if rows and "called_moving" in rows[0]:
                    yield f"{name}, other recordings", make.recordings(rows)


def states_of(rows: list[Row]) -> str:
    """Return commits and days of rows; of two, which methods are of each."""
    states: dict[str, list[str]] = {}
    for row in rows:
        of = states.setdefault(f"{row['head']['commit']}, {row['head']['date']}", [])
        if row.get("method") and f"`{row['method']}`" not in of:
            of.append(f"`{row['method']}`")
    has_methods = len(states) == 2 and all(states.values())
    return "; ".join(f"{state}: {', '.join(of)}" if has_methods else state for state, of in states.items())


def markdown(name: str, results: dict[str, Result]) -> str:
    """Return table `name` as the stored results have it, and what they are of; where there is none, how to make it."""
    table = TABLES[name]
    command = f"`python benchmarks/run.py {table.benchmark}`"
    if table.benchmark not in results:
        return f"Not run yet: {command}.\n"
    result = results[table.benchmark]
    heading, *lines = table.lines(result)
    head, *body = (f"| {' | '.join(cells)} |\n" for cells in (heading, *lines))
    said = f"\n{command}, {states_of(table.rows(result) or result['rows'])}.\n"
    return f"{head}|---{'|---:' * (len(heading) - 1)}|\n{''.join(body)}{said}"


def with_tables(page: str, results: dict[str, Result]) -> str:
    """Return the text of a page with its tables as `results`, by benchmark, have them."""
    return MARK.sub(lambda mark: mark["head"] + markdown(mark["name"], results) + mark["end"], page)


def names_in(page: str) -> Iterator[str]:
    """Yield the names of the tables of a page."""
    yield from (mark["name"] for mark in MARK.finditer(page))
