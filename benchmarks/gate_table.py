"""The tables of the gate: this code's scores, beside those of a stored table, cell by cell."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table
from suite import calibration_error

WORST = 1.0
"""Points of IoU that a cell may lose."""
Rows = dict[str, dict]


def has_movers(row: dict) -> bool:
    """Whether anything moves there, to anyone's knowledge: IoU has a meaning."""
    return row["true_points"] + row["missed_points"] > 0


def is_still(row: dict) -> bool:
    """Whether it is known that nothing moves there: false points count."""
    return row["points"] > 0 and not has_movers(row)


def calibration(rows: Rows) -> dict[str, list[float]]:
    """Return the expected calibration errors of static and moving points, by sensor."""
    return {
        sensor: [calibration_error(sum(np.array(rows[key]["reliability"][k]) for key in keys)) for k in (0, 1)]
        for sensor, keys in _sensors(rows).items()
    }


def draw_reliability(table: dict, file: Path) -> None:
    """Draw how often points of each confidence are labelled rightly, static and moving ones, by sensor."""
    rows = {key: row for key, row in _read(table).items() if key[0].isdigit()}
    figure = Figure((9.0, 4.2), layout="constrained")
    for k, kind in enumerate(("static", "moving")):
        axes = figure.add_subplot(1, 2, k + 1)
        axes.plot([0, 1], [0, 1], color="#9aa0a6", linewidth=1)
        for sensor, keys in _sensors(rows).items():
            n, sure, right = np.sum([np.array(rows[key]["reliability"][k]) for key in keys], axis=0).T
            there = n > 0.001 * n.sum()
            axes.plot(sure[there] / n[there], right[there] / n[there], marker="o", label=sensor)
        axes.set(
            xlabel="confidence",
            ylabel="share labelled rightly",
            title=f"points labelled {kind}",
            xlim=(0, 1),
            ylim=(0, 1),
        )
        axes.legend(frameon=False, loc="upper left")
    FigureCanvasAgg(figure)
    figure.savefig(file, dpi=110)


def print_tables(table: dict, before: dict | None) -> None:
    """Print worlds, real recordings and conventions, each beside the same cell of the table `before`."""
    console, rows = Console(width=160), _read(table)
    old = {} if before is None else _read(before)
    if before is not None:
        console.print(f"{table['name']} against {before['name']} ({before['date']})")
        for what in ("preset", "scans", "simulator_format"):
            if table[what] != before[what]:
                console.print(f"[bold]not the same {what}: {table[what]}, before {before[what]}: no comparison")
                old = {}
    worlds = {key: row for key, row in rows.items() if key[0].isdigit()}
    if worlds:
        console.print(_by_scenario(worlds, old))
        console.print(_by_sensor(worlds, old))
    rest = {key: row for key, row in rows.items() if not key[0].isdigit()}
    if rest:
        console.print(_recordings(rest, old))
    for key, row in table["rows"].items():
        if "refused" in row:
            console.print(f"{key} was refused: {row['refused']}", style="red", markup=False)
    for line in verdicts(rows, old):
        console.print(line)


def _read(table: dict) -> Rows:
    """Return the rows of what was labelled."""
    return {key: row for key, row in table["rows"].items() if "refused" not in row}


def verdicts(rows: Rows, old: Rows) -> list[str]:
    """Return what got worse by the gate's rules: a sensor's mean, a cell by more than WORST, false points, cost."""
    both = [key for key in rows if key in old]
    if not both:
        return ["nothing to compare with"]
    new, was = {key: rows[key] for key in both}, {key: old[key] for key in both}
    said = []
    for sensor, keys in _sensors(new).items():
        a, b = _mean_iou(new, keys), _mean_iou(was, keys)
        if a < b - 0.05:
            said.append(f"mean of {sensor} fell from {b:.1f} to {a:.1f}")
    for key in (key for key in both if has_movers(new[key])):
        change = 100 * (new[key]["iou"] - was[key]["iou"])
        if change < -WORST:
            said.append(f"{key} fell by {-change:.1f} to {100 * new[key]['iou']:.1f}")
    for name, of in _GROWING.items():
        a, b = of(new), of(was)
        if a > 1.03 * b:
            said.append(f"{name} grew from {b:,.4g} to {a:,.4g}")
    return [f"[red]worse: {line}" for line in said] or [f"[green]nothing is worse in {len(both)} cells"]


def _false_where_still(rows: Rows) -> float:
    return sum(row["called_moving"] for row in rows.values() if is_still(row))


def _seconds_a_scan(rows: Rows) -> float:
    return sum(row["cpu_seconds"] for row in rows.values()) / sum(row["scans"] for row in rows.values())


def _peak(rows: Rows) -> float:
    return max((row["peak_mb"] or 0.0 for row in rows.values()), default=0.0)


_GROWING: dict[str, Callable[[Rows], float]] = {
    "points called moving where nothing moves": _false_where_still,
    "processor seconds a scan": _seconds_a_scan,
    "peak MB": _peak,
}


def _sensors(rows: Rows) -> dict[str, list[str]]:
    """Return the keys of worlds by sensor."""
    found: dict[str, list[str]] = {}
    for key in rows:
        if key[0].isdigit():
            found.setdefault(key.split("/")[2], []).append(key)
    return found


def _mean_iou(rows: Rows, keys: list[str]) -> float:
    ious = [100 * rows[key]["iou"] for key in keys if has_movers(rows[key])]
    return float(np.mean(ious)) if ious else float("nan")


def _by_scenario(rows: Rows, old: Rows) -> Table:
    sensors = _sensors(rows)
    table = Table("scenario", *sensors, title="worlds: mean IoU % (change), or false points where nothing moves")
    for scenario in dict.fromkeys(key.split("/")[1] for key in rows):
        cells = []
        for keys in sensors.values():
            here = [key for key in keys if key.split("/")[1] == scenario]
            cells.append(_cell({key: rows[key] for key in here}, old))
        table.add_row(scenario, *cells)
    return table


def _cell(rows: Rows, old: Rows) -> str:
    if rows and all(map(is_still, rows.values())):
        change = sum(r["false_points"] - old[key]["false_points"] for key, r in rows.items() if key in old)
        return f"{sum(r['false_points'] for r in rows.values())} false ({change:+d})"
    moving = [key for key in rows if has_movers(rows[key])]
    shared = [key for key in moving if key in old]
    change = _mean_iou(rows, shared) - _mean_iou(old, shared) if shared else float("nan")
    if not moving:
        return "-"
    return f"{_mean_iou(rows, moving):.1f}" + ("" if np.isnan(change) else f" ({change:+.1f})")


def _by_sensor(rows: Rows, old: Rows) -> Table:
    headings = (
        "mean IoU %",
        "worst cell",
        "fell most",
        "false where still",
        "CPU s a scan",
        "peak MB",
        "ECE static",
        "ECE moving",
    )
    table = Table("sensor", *headings, title="worlds by sensor")
    for sensor, keys in _sensors(rows).items():
        here = {key: rows[key] for key in keys}
        moving = [key for key in keys if has_movers(rows[key])]
        worst = min(moving, key=lambda key: rows[key]["iou"], default=None)
        falls = {key: 100 * (rows[key]["iou"] - old[key]["iou"]) for key in moving if key in old}
        fell = min(falls, key=lambda key: falls[key], default=None)
        table.add_row(
            sensor,
            _cell({key: rows[key] for key in moving}, old),
            "" if worst is None else f"{100 * rows[worst]['iou']:.1f} {_short(worst)}",
            "" if fell is None else f"{falls[fell]:+.1f} {_short(fell)}",
            f"{_false_where_still(here):,}",
            f"{_seconds_a_scan(here):.3f}" + _was(here, old, _seconds_a_scan, ".3f"),
            f"{_peak(here):.0f}" + _was(here, old, _peak, ".0f"),
            *(f"{error:.3f}" for error in calibration(rows)[sensor]),
        )
    return table


def _was(rows: Rows, old: Rows, of: Callable[[Rows], float], style: str) -> str:
    """Return " (before)" where all of `rows` were measured before."""
    return f" ({of({key: old[key] for key in rows}):{style}})" if all(key in old for key in rows) else ""


def _short(key: str) -> str:
    return "/".join(key.split("/")[:2])


def _recordings(rows: Rows, old: Rows) -> Table:
    table = Table("", "IoU %", "points moving", "% moving", "CPU s a scan", "peak MB", title="recordings")
    for key, row in rows.items():
        was = old.get(key)
        iou = "" if not has_movers(row) else f"{100 * row['iou']:.1f}"
        if was and iou:
            iou += f" ({100 * (row['iou'] - was['iou']):+.1f})"
        moving = f"{row['called_moving']:,}" + (f" ({row['called_moving'] - was['called_moving']:+,})" if was else "")
        seconds = f"{row['cpu_seconds'] / row['scans']:.3f}" + _was({key: row}, old, _seconds_a_scan, ".3f")
        table.add_row(key, iou, moving, f"{row['percent_moving']:.4f}", seconds, f"{row['peak_mb'] or 0:.0f}")
    return table
