"""The tables of README and docs: which job makes each, and how its stored result is written there."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results" / "tables"
MARK = re.compile(r"(?P<head><!-- table (?P<name>[\w-]+) -->\n).*?(?P<end><!-- end -->)", re.DOTALL)
Rows = list[list[str]]


@dataclass(frozen=True)
class Job:
    """One script with fixed arguments; `DRIVE_0005` and `CACHE` in them are replaced."""

    name: str
    script: str
    arguments: tuple[str, ...]

    @property
    def needs_drive(self) -> bool:
        return "DRIVE_0005" in self.arguments


JOBS = {
    job.name: job
    for job in (
        Job(
            "presets",
            "table1.py",
            ("DRIVE_0005", *["--scenarios", "none", "--methods", "paper", "default", "--cache", "CACHE/table1"]),
        ),
        Job("drive", "table1.py", ("DRIVE_0005", "--scenarios", "none", "--repeat", "3", "--cache", "CACHE/table1")),
        Job("worlds", "table1.py", ("--scans", "40", "--seed", "60", "--cache", "CACHE/table1")),
        Job("suite", "suite.py", ("--seed", "60", "--cache", "CACHE/suite")),
        Job("robustness", "robustness.py", ("DRIVE_0005",)),
        Job("ablation", "ablation.py", ("DRIVE_0005",)),
        Job("speed", "speed.py", ("DRIVE_0005", "--repeat", "3")),
        Job("speed-paper", "speed.py", ("DRIVE_0005", "--repeat", "3", "--preset", "paper")),
    )
}
"""Seed 60 of the simulator is for these tables: nothing was chosen on it."""


def _percent(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.1f}"


def _only(result: dict) -> dict:
    (recording,) = result.values()
    return recording


def _methods_of_drive(result: dict) -> Rows:
    rows = [["method", "IoU", "precision", "recall", "s/scan", "spread", "CPU s/scan", "peak MB", "asks the future"]]
    for method in _only(result)["methods"].values():
        ratios = [_percent(method[key]) for key in ("iou", "precision", "recall")]
        alone = (method.get("cores_of_others") or 0.0) <= 0.1
        cost = [
            f"{'' if alone else '< '}{method['seconds_per_scan']:.2f}",
            f"{method['seconds_spread']:.2f}" if method["runs"] > 1 else "",
            "" if method["cpu_seconds_per_scan"] is None else f"{method['cpu_seconds_per_scan']:.2f}",
            "" if method["peak_mb"] is None else f"{method['peak_mb']:.0f}",
        ]
        rows.append([method["title"], *ratios, *cost, "yes" if method["needs_future"] else "no"])
    return rows


def _presets_of_drive(result: dict) -> Rows:
    methods = _only(result)["methods"]
    rows = [["preset", "IoU", "precision", "recall"]]
    for preset in ("paper", "default"):
        rows.append([f"`{preset}`", *(_percent(methods[preset][key]) for key in ("iou", "precision", "recall"))])
    return rows


def _methods_of_worlds(result: dict) -> Rows:
    """One row a method, one column a world; where nothing moves, false points a scan, in brackets."""
    rows = [["method", *(f"`{world}`" for world in result)]]
    titles = {name: m["title"] for world in result.values() for name, m in world["methods"].items()}
    for name, title in titles.items():
        rows.append([title, *(_cell(world, name) for world in result.values())])
    return rows


def _cell(world: dict, method: str) -> str:
    found = world["methods"].get(method)
    if found is None:
        return ""
    if found["true_dynamic"] + found["false_static"] == 0:
        return f"({found['false_dynamic'] / world['n_scans']:.0f})"
    return _percent(found["iou"])


def _suite(preset: str) -> Callable[[list[dict]], Rows]:
    def rows(result: list[dict]) -> Rows:
        cells = {tuple(row["cell"]): row for row in result if row["cell"][2] == preset}
        sensors, worlds = list(dict.fromkeys(c[1] for c in cells)), list(dict.fromkeys(c[0] for c in cells))
        return [
            ["world", *sensors],
            *(
                [f"`{world}`", *(_percent(cells[world, sensor, preset]["iou"]) for sensor in sensors)]
                for world in worlds
            ),
        ]

    return rows


def _robustness(result: list[dict]) -> Rows:
    plain = {row["recording"]: row["iou"] for row in result if row["case"] == "as it is"}
    return [
        ["", "IoU", "change"],
        *(
            [row["case"], _percent(row["iou"]), f"{100 * (row['iou'] - plain[row['recording']]):+.1f}"]
            for row in result
        ),
    ]


def _ablation(result: list[dict]) -> Rows:
    return [["", "IoU", "false points"], *([r["choice"], _percent(r["iou"]), f"{r['false']:,}"] for r in result)]


def _speed(result: list[dict]) -> Rows:
    rows = [["stage", *(f"{row['scans']} scans" for row in result)]]
    for stage in result[0]["seconds_per_scan"]:
        rows.append([stage, *(f"{row['seconds_per_scan'][stage]:.3f} s" for row in result)])
    rows.append(["processor time", *(f"{row['cpu_seconds_per_scan']:.3f} s" for row in result)])
    rows.append(["peak memory", *(f"{row['peak_mb']['all']:.0f} MB" for row in result)])
    return rows


TABLES: dict[str, tuple[str, Callable[[Any], Rows]]] = {
    "presets-drive": ("presets", _presets_of_drive),
    "methods-drive": ("drive", _methods_of_drive),
    "methods-worlds": ("worlds", _methods_of_worlds),
    "suite-default": ("suite", _suite("default")),
    "suite-paper": ("suite", _suite("paper")),
    "robustness": ("robustness", _robustness),
    "ablation": ("ablation", _ablation),
    "speed-default": ("speed", _speed),
    "speed-paper": ("speed-paper", _speed),
}
"""Each table's job, and what makes its rows (the heading first) of the job's result."""


def pages() -> list[Path]:
    """Return README and all pages of the docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def read_result(job: str) -> dict | None:
    """Return what is stored of `job`, None where it was never run."""
    file = RESULTS / f"{job}.json"
    return json.loads(file.read_text()) if file.exists() else None


def state_of(job: Job, code: str) -> str:
    """Return in words whether what is stored of `job` is of the code with digest `code`."""
    stored = read_result(job.name)
    if stored is None:
        return "never run"
    return "up to date" if stored["code"] == code else f"of another state ({stored['commit']}, {stored['date']})"


def markdown(name: str, stored: dict) -> str:
    """Return table `name` of its job's stored result, with the state it is of."""
    heading, *rows = TABLES[name][1](stored["result"])
    lines = [heading, ["---", *["---:"] * (len(heading) - 1)], *rows]
    table = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    return f"{table}\n`{stored['command']}`, {stored['commit']}, {stored['date']}.\n"


def with_tables(page: str, results: dict[str, dict]) -> str:
    """Return the text of a page with its tables as `results`, by job, have them; those without a result stay."""

    def replaced(mark: re.Match[str]) -> str:
        job = TABLES[mark["name"]][0]
        return mark[0] if job not in results else mark["head"] + markdown(mark["name"], results[job]) + mark["end"]

    return MARK.sub(replaced, page)


def names_in(page: str) -> Iterator[str]:
    """Yield the names of the tables of a page."""
    yield from (mark["name"] for mark in MARK.finditer(page))
