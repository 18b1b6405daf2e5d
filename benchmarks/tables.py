"""The tables of README and docs: which jobs make each, and how their stored results are written there."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from jobs import JOBS, RIVALS, Job

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results" / "tables"
MARK = re.compile(r"(?P<head><!-- table (?P<name>[\w-]+) -->\n)(?P<shown>.*?)(?P<end><!-- end -->)", re.DOTALL)
Rows = list[list[str]]


REPORTED = {
    "octomap": "8.8-48.4",
    "removert": "53.6-82.7",
    "erasor": "8.0-23.5",
    "dufomap": "76.4",
    "m_detector": "86.4",
    "hmm_mos": "75.1",
}
"""IoU of public implementations on the drive, with their shipped settings and KISS-ICP's poses; by rule where two."""


def _percent(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.1f}"


def _only(result: dict) -> dict:
    (recording,) = result.values()
    return recording


def _methods_of_drive(*results: dict) -> Rows:
    rows = [["method", "IoU", "precision", "recall", "reported", "s/scan", "spread", "CPU s/scan", "peak MB", "future"]]
    for name, method in _joined(results)["methods"].items():
        ratios = [_percent(method[key]) for key in ("iou", "precision", "recall")]
        alone = (method.get("cores_of_others") or 0.0) <= 0.1
        cost = [
            f"{'' if alone else '< '}{method['seconds_per_scan']:.2f}",
            f"{method['seconds_spread']:.2f}" if method["runs"] > 1 else "",
            "" if method["cpu_seconds_per_scan"] is None else f"{method['cpu_seconds_per_scan']:.2f}",
            "" if method["peak_mb"] is None else f"{method['peak_mb']:.0f}",
        ]
        future = "yes" if method["needs_future"] else "no"
        rows.append([method["title"], *ratios, REPORTED.get(name, ""), *cost, future])
    return rows


def _joined(results: tuple[dict, ...]) -> dict:
    """Return the only recording of several results, with the methods of all of them."""
    parts = [_only(result) for result in results]
    return {**parts[0], "methods": {name: method for part in parts for name, method in part["methods"].items()}}


def _presets_of_drive(result: dict) -> Rows:
    methods = _only(result)["methods"]
    rows = [["preset", "IoU", "precision", "recall"]]
    for preset in ("paper", "default"):
        rows.append([f"`{preset}`", *(_percent(methods[preset][key]) for key in ("iou", "precision", "recall"))])
    return rows


def _methods_of_worlds(*results: dict) -> Rows:
    """One row a method, one column a world of all results; where nothing moves, false points a scan, in brackets."""
    common = [world for world in results[0] if all(world in result for result in results)]
    worlds = {world: _joined(tuple({world: result[world]} for result in results)) for world in common}
    rows = [["method", *(f"`{world}`" for world in worlds)]]
    titles = {name: m["title"] for world in worlds.values() for name, m in world["methods"].items()}
    for name, title in titles.items():
        rows.append([title, *(_cell(world, name) for world in worlds.values())])
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
                [f"`{world}`", *(_cell_of_suite(cells[world, sensor, preset]) for sensor in sensors)]
                for world in worlds
            ),
        ]

    return rows


def _cell_of_suite(row: dict) -> str:
    """Return the IoU; where nothing moves false points a scan, in brackets."""
    nothing_moves = row["true_points"] + row["missed_points"] == 0
    return f"({row['false_points'] / row['scans']:.1f})" if nothing_moves else _percent(row["iou"])


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


TABLES: dict[str, tuple[tuple[str, ...], Callable[..., Rows]]] = {
    "presets-drive": (("presets",), _presets_of_drive),
    "methods-drive": ((*(f"drive-{rival}" for rival in RIVALS), "presets"), _methods_of_drive),
    "methods-worlds": ((*(f"worlds-{rival}" for rival in RIVALS), "worlds-presets"), _methods_of_worlds),
    "suite-default": (("suite",), _suite("default")),
    "suite-paper": (("suite",), _suite("paper")),
    "robustness": (("robustness",), _robustness),
    "ablation": (("ablation",), _ablation),
    "speed-default": (("speed",), _speed),
    "speed-paper": (("speed-paper",), _speed),
}
"""Each table's jobs, and what makes its rows (the heading first) of their results."""

OVERVIEW = "jobs"
"""The table of all jobs: what was run, when, in which form; and what was not."""


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
    form = ", the short form" if stored["is_quick"] else ""
    return f"up to date{form}" if stored["code"] == code else f"of another state ({_made(stored)}){form}"


def _made(stored: dict) -> str:
    return f"{stored['commit']}, {stored['date']}"


def _said(names: Iterable[str], results: dict[str, dict]) -> list[str]:
    """Return in a line or more what made a table, and which of its jobs were not run."""
    made = [name for name in names if name in results]
    if len(made) <= 2:
        said = []
        for name in made:
            job, stored = JOBS[name], results[name]
            short = f"; a part of `{job.command(False)}`" if stored["is_quick"] else ""
            said.append(f"`{job.command(stored['is_quick'])}`, {_made(stored)}{short}.")
    else:
        states: dict[str, list[str]] = {}
        for name in made:
            form = ", short form" if results[name]["is_quick"] else ""
            states.setdefault(_made(results[name]) + form, []).append(f"`{name}`")
        said = [f"`benchmarks/all.py`, {state}: {', '.join(which)}." for state, which in states.items()]
    missing = [name for name in names if name not in results]
    return [*said, *([_to_run(missing).rstrip()] if missing else [])]


def _to_run(missing: list[str]) -> str:
    if len(missing) > 2:
        return f"Not run for this state: {', '.join(f'`{name}`' for name in missing)} of `benchmarks/all.py`.\n"
    return f"Not run for this state: `{'`, `'.join(JOBS[name].command(False) for name in missing)}`.\n"


def _overview(results: dict[str, dict]) -> Rows:
    rows = [["job", "run", "commit", "date"]]
    for name, job in JOBS.items():
        if (stored := results.get(name)) is None:
            rows.append([f"`{name}`", f"not run: `{job.command(False)}`", "", ""])
        else:
            what = f"`{job.command(stored['is_quick'])}`" + (", the short form" if stored["is_quick"] else "")
            rows.append([f"`{name}`", what, stored["commit"], stored["date"]])
    return rows


def markdown(name: str, results: dict[str, dict]) -> str | None:
    """Return table `name` of its jobs' stored results, with the states they are of; None where none was ever run.

    Jobs that were not run are named below it.
    """
    if name == OVERVIEW:
        (heading, *rows), said, numbers = _overview(results), [], "---"
    else:
        jobs, make = TABLES[name]
        made = [job for job in jobs if job in results]
        if not made:
            return None
        heading, *rows = make(*(results[job]["result"] for job in made))
        said, numbers = _said(jobs, results), "---:"
    lines = [heading, ["---", *[numbers] * (len(heading) - 1)], *rows]
    table = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    return table + "".join(f"\n{line}\n" for line in said)


def with_tables(page: str, results: dict[str, dict]) -> str:
    """Return the text of a page with its tables as `results`, by job, have them; others stay, or say what is to run."""

    def replaced(mark: re.Match[str]) -> str:
        made = markdown(mark["name"], results)
        if made is None and mark["shown"].startswith("|"):
            return mark[0]
        if made is None:
            made = _to_run([job for job in TABLES[mark["name"]][0] if job not in results])
        return mark["head"] + made + mark["end"]

    return MARK.sub(replaced, page)


def names_in(page: str) -> Iterator[str]:
    """Yield the names of the tables of a page."""
    yield from (mark["name"] for mark in MARK.finditer(page))
