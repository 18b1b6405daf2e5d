"""What the tables of README and docs show of each script's result: a heading, then rows of text."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

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


def methods_of_drive(*results: dict) -> Rows:
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


def presets_of_drive(result: dict) -> Rows:
    methods = _only(result)["methods"]
    rows = [["preset", "IoU", "precision", "recall"]]
    for preset in ("paper", "default"):
        rows.append([f"`{preset}`", *(_percent(methods[preset][key]) for key in ("iou", "precision", "recall"))])
    return rows


def presets_of_worlds(result: dict) -> Rows:
    """One row a preset: the mean over worlds in which something moves, the worst of them; false points elsewhere."""
    rows = [["preset", "mean IoU", "precision", "recall", "worst world", "false points a scan where nothing moves"]]
    for preset in ("paper", "default"):
        by_world = {world: found["methods"][preset] for world, found in result.items()}
        moving = {world: m for world, m in by_world.items() if m["true_dynamic"] + m["false_static"]}
        means = [_percent(float(np.mean([m[key] for m in moving.values()]))) for key in ("iou", "precision", "recall")]
        worst = min(moving, key=lambda world: moving[world]["iou"])
        false = sum(by_world[w]["false_dynamic"] / result[w]["n_scans"] for w in by_world if w not in moving)
        rows.append([f"`{preset}`", *means, f"{_percent(moving[worst]['iou'])} `{worst}`", f"{false:.1f}"])
    return rows


def methods_of_worlds(*results: dict) -> Rows:
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


def suite(preset: str) -> Callable[[list[dict]], Rows]:
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


def robustness(result: list[dict]) -> Rows:
    plain = {row["recording"]: row["iou"] for row in result if row["case"] == "as it is"}
    return [
        ["", "IoU", "change"],
        *(
            [row["case"], _percent(row["iou"]), f"{100 * (row['iou'] - plain[row['recording']]):+.1f}"]
            for row in result
        ),
    ]


def ablation(result: list[dict]) -> Rows:
    return [["", "IoU", "false points"], *([r["choice"], _percent(r["iou"]), f"{r['false']:,}"] for r in result)]


def ablation_of_recordings(result: list[dict]) -> Rows:
    """One row a choice, one column a recording: IoU, and the false points."""
    recordings = list(dict.fromkeys(row["recording"] for row in result))
    cells = {(r["choice"], r["recording"]): f"{_percent(r['iou'])} ({r['false']:,})" for r in result}
    choices = list(dict.fromkeys(row["choice"] for row in result))
    return [["", *recordings], *([choice, *(cells[choice, of] for of in recordings)] for choice in choices)]


def ablation_by_recording(result: list[dict]) -> Rows:
    """The same with one row a recording, one column a choice."""
    return [list(row) for row in zip(*ablation_of_recordings(result), strict=True)]


def speed(result: list[dict]) -> Rows:
    rows = [["stage", *(f"{row['scans']} scans" for row in result)]]
    for stage in result[0]["seconds_per_scan"]:
        rows.append([stage, *(f"{row['seconds_per_scan'][stage]:.3f} s" for row in result)])
    rows.append(["processor time", *(f"{row['cpu_seconds_per_scan']:.3f} s" for row in result)])
    rows.append(["peak memory", *(f"{row['peak_mb']['all']:.0f} MB" for row in result)])
    return rows


def gate(result: dict) -> Rows:
    """One row a world, one column a sensor: IoU, and the false points; then means, cost and calibration."""
    rows = result["rows"]
    sensors = list(dict.fromkeys(_part(key, 2) for key in rows))
    by_sensor = [[row for key, row in rows.items() if _part(key, 2) == sensor] for sensor in sensors]
    worlds = list(dict.fromkeys(_part(key, 1) for key in rows))
    cells = {world: [_with_false(_of(rows, world, sensor)) for sensor in sensors] for world in worlds}
    errors = [result["calibration"][sensor] for sensor in sensors]
    return [
        ["world", *sensors],
        *([f"`{world}`", *cells[world]] for world in worlds),
        ["**mean**", *(f"**{_percent(np.mean([r['iou'] for r in some if _moves(r)]))}**" for some in by_sensor)],
        ["processor seconds a scan", *(f"{_mean_seconds(some):.2f}" for some in by_sensor)],
        ["peak memory, MB", *(f"{max(row['peak_mb'] or 0 for row in some):.0f}" for some in by_sensor)],
        ["calibration error, moving", *(f"{moving:.3f}" for _, moving in errors)],
        ["calibration error, static", *(f"{static:.3f}" for static, _ in errors)],
    ]


def gate_recordings(result: dict) -> Rows:
    """One row a recording: IoU where there is truth, and the points called moving."""
    rows = [["recording", "IoU", "points moving", "share"]]
    for key, row in result["rows"].items():
        if "refused" in row:
            rows.append([key.split("/")[-1], "refused", "", ""])
        else:
            iou = _percent(row["iou"]) if _moves(row) else ""
            rows.append([key.split("/")[-1], iou, f"{row['called_moving']:,}", f"{row['percent_moving']:.4f} %"])
    return rows


def trust(result: dict) -> Rows:
    """The drives that are off or warned of, one by one; the others in one row."""
    rows, others = [["drive", "off by", "warned"]], []
    for name, row in sorted(result.items(), key=lambda item: -item[1]["off"]):
        if row["off"] > 0.03 or row["said"]:
            rows.append([name, f"{100 * row['off']:.1f} %", "yes" if row["said"] else "no"])
        else:
            others.append(row["off"])
    return [*rows, [f"the other {len(others)}", f"{100 * max(others, default=0.0):.1f} % at most", "no"]]


def online(result: list[dict]) -> Rows:
    rows = [["lag", "IoU", "precision", "recall", "not known", "median, p99 of a push", "scans/s", "peak MB"]]
    for row in result:
        shares = [_percent(row[name]) for name in ("iou", "precision", "recall", "unlabeled")]
        cost = [f"{row['median_ms']:.0f}, {row['p99_ms']:.0f} ms", f"{row['scans_a_second']:.1f}"]
        rows.append([f"{row['lag']:g} s", *shares[:3], f"{shares[3]} %", *cost, f"{row['peak_mb']:.0f}"])
    return rows


def online_suite(result: list[dict]) -> Rows:
    """One row a world, one column a sensor and lag; in brackets false points where nothing moves."""
    cells = {tuple(row["cell"][1:]): row for row in result}
    columns = list(dict.fromkeys(key[1:] for key in cells))
    worlds = list(dict.fromkeys(key[0] for key in cells))
    means = [np.mean([cells[(w, *c)]["iou"] for w in worlds if _moves(cells[(w, *c)])]) for c in columns]
    return [
        ["world", *(f"{sensor}, {lag:g} s" for sensor, lag in columns)],
        *([f"`{world}`", *(_iou_or_false(cells[(world, *column)]) for column in columns)] for world in worlds),
        ["**mean**", *(f"**{_percent(mean)}**" for mean in means)],
    ]


def drift(result: dict) -> Rows:
    """Errors of the odometry in percent, before and after refinement, and how thick walls come out."""
    rows = [["recording", "10 m, registered", "10 m, refined", "1 s, refined", "5 s, refined", "walls, cm"]]
    for name, row in result.items():
        before, after = row["before"], row["after"]
        walls = [before["walls_m"], after["walls_m"], row["walls_reference_m"]]
        shown = " / ".join("-" if metres is None else f"{100 * metres:.1f}" for metres in walls)
        errors = [_errors(before["10 m"]), *(_errors(after[over]) for over in ("10 m", "1 s", "5 s"))]
        rows.append([name.rsplit("-v", 1)[0], *errors, shown])
    return rows


def end_drift(result: dict) -> Rows:
    """How far off the last scan of each world is with either preset, metres and percent of the way."""
    rows = [["scenario", "way, m", "`paper`: drift, m", "%", "over 1 s, m", "`default`: drift, m", "%", "over 1 s, m"]]
    for scenario, by_preset in result.items():
        way, cells = by_preset["paper"]["way_m"], []
        for row in (by_preset["paper"], by_preset["default"]):
            percent = f"{100 * row['drift_m'] / way:.1f}" if way > 1.0 else "-"
            cells += [f"{row['drift_m']:.2f}", percent, f"{row['over_1s_m']:.3f}"]
        rows.append([f"`{scenario}`", f"{way:.0f}", *cells])
    return rows


def as_it_is(result: Rows) -> Rows:
    """What a script has tabulated itself."""
    return result


def _errors(found: dict | None) -> str:
    return "-" if found is None else f"{found['mean']:.2f} / {found['max']:.2f}"


def _part(key: str, place: int) -> str:
    return key.split("/")[place]


def _of(rows: dict[str, dict], world: str, sensor: str) -> dict:
    return next(row for key, row in rows.items() if key.split("/")[1:] == [world, sensor])


def _moves(row: dict) -> bool:
    return row["true_points"] + row["missed_points"] > 0


def _with_false(row: dict) -> str:
    return f"{_percent(row['iou'])} ({row['false_points']:,})" if _moves(row) else f"({row['false_points']:,})"


def _iou_or_false(row: dict) -> str:
    return _percent(row["iou"]) if _moves(row) else f"({row['false_points']:,})"


def _mean_seconds(rows: list[dict]) -> float:
    return sum(row["cpu_seconds"] for row in rows) / sum(row["scans"] for row in rows)
