"""The tables of README and docs: which jobs make each, and how their stored results are written there."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import rows as make_rows
import rows_beside_labels as beside
import rows_of_cost as of_cost
from job import Job
from jobs import JOBS, RIVALS
from rows import Rows

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results" / "tables"
MARK = re.compile(r"(?P<head><!-- table (?P<name>[\w-]+) -->\n)(?P<shown>.*?)(?P<end><!-- end -->)", re.DOTALL)


TABLES: dict[str, tuple[tuple[str, ...], Callable[..., Rows]]] = {
    "presets-worlds": (("worlds-presets",), make_rows.presets_of_worlds),
    "presets-drive": (("presets",), make_rows.presets_of_drive),
    "methods-drive": ((*(f"drive-{rival}" for rival in RIVALS), "presets"), make_rows.methods_of_drive),
    "methods-worlds": ((*(f"worlds-{rival}" for rival in RIVALS), "worlds-presets"), make_rows.methods_of_worlds),
    "suite-default": (("suite",), make_rows.suite("default")),
    "suite-paper": (("suite",), make_rows.suite("paper")),
    "robustness": (("robustness",), make_rows.robustness),
    "ablation": (("ablation",), make_rows.ablation),
    "speed-default": (("speed",), make_rows.speed),
    "speed-paper": (("speed-paper",), make_rows.speed),
    "gate": (("gate",), make_rows.gate),
    "gate-recordings": (("gate-recordings",), make_rows.gate_recordings),
    "conventions": (("conventions",), make_rows.as_it_is),
    "point-times": (("point-times",), make_rows.as_it_is),
    "trust": (("trust",), make_rows.trust),
    "ablation-gate": (("ablation-gate",), make_rows.as_it_is),
    "ablation-sensors": (("ablation-sensors",), make_rows.as_it_is),
    "ablation-recorders": (("ablation-recorders",), make_rows.ablation_of_recordings),
    "ablation-bodies": (("ablation-bodies",), make_rows.ablation_by_recording),
    "ablation-hills": (("ablation-hills",), make_rows.ablation_by_recording),
    "ablation-odometry": (("ablation-odometry",), make_rows.as_it_is),
    "online": (("online",), make_rows.online),
    "online-suite": (("online-suite",), make_rows.online_suite),
    "short-recordings": (("short-recordings",), make_rows.as_it_is),
    "other-sensors": (("other-sensors",), make_rows.as_it_is),
    "simulator-odometry": (("simulator-odometry",), make_rows.end_drift),
    "odometry": (("odometry",), make_rows.drift),
    "table-2": (("table-2",), beside.networks),
    "table-3": (("table-3",), beside.networks),
    "fine-tuning": (("table-3",), beside.fine_tuning),
    "self-training": (("self-training",), beside.self_training),
    "segment-speed": (("segment-speed",), beside.segment_speed),
    "shipped-network": (("shipped-network",), beside.shipped_network),
    "simulator-statistics": (("simulator-statistics",), beside.simulator_statistics),
    "reference-poses": (("reference-poses",), beside.reference_poses),
    "maps": (("maps",), beside.maps),
    "hmm_mos": (("drive-hmm_mos",), beside.hmm_mos),
    "m_detector-in-parts": (("rivals-in-parts",), beside.rivals_in_parts("M-detector")),
    "hmm_mos-in-parts": (("rivals-in-parts",), beside.rivals_in_parts("HMM-MOS")),
    "sampling": (("sampling",), beside.sampling),
    "review-queue": (("review-queue",), beside.review_queue),
    "review": (("review",), beside.review),
    "first-minute": (("first-minute",), of_cost.first_minute),
    "simulator-speed": (("simulator-speed",), of_cost.simulator_speed),
    "cost": (("speed", "speed-paper"), of_cost.cost),
    "scale": (("scale",), of_cost.scale),
    "libraries": (("libraries",), of_cost.libraries),
    "packages": (("libraries",), of_cost.packages),
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


EARLIER = "Of an earlier state. "
"""What is said of a table of which no result is stored, and which does not say itself what it is of."""


def _kept(shown: str, missing: list[str]) -> str:
    """Return a table of which nothing is stored as the page has it, and that it is of an earlier state."""
    table = "".join(line for line in shown.splitlines(keepends=True) if line.startswith("|"))
    below = shown.removeprefix(table).strip()
    return shown if below and not below.startswith(EARLIER) else f"{table}\n{EARLIER}{_to_run(missing)}"


def with_tables(page: str, results: dict[str, dict]) -> str:
    """Return the text of a page with its tables as `results`, by job, have them; others stay, or say what is to run."""

    def replaced(mark: re.Match[str]) -> str:
        made = markdown(mark["name"], results)
        if made is None:
            missing = [job for job in TABLES[mark["name"]][0] if job not in results]
            made = _kept(mark["shown"], missing) if mark["shown"].startswith("|") else _to_run(missing)
        return mark["head"] + made + mark["end"]

    return MARK.sub(replaced, page)


def names_in(page: str) -> Iterator[str]:
    """Yield the names of the tables of a page."""
    yield from (mark["name"] for mark in MARK.finditer(page))
