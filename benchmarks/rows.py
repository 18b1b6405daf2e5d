"""What the tables of README and docs show of each benchmark's result: a heading, then rows of text."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from cases import CASES

Row = dict[str, Any]
Lines = list[list[str]]

REPORTED = {
    "octomap": "8.8-48.4",
    "removert": "53.6-82.7",
    "erasor": "8.0-23.5",
    "dufomap": "76.4",
    "m_detector": "86.4",
    "hmm_mos": "75.1",
}
"""IoU of public implementations on the drive, with their shipped settings and KISS-ICP's poses; by rule where two."""
REPORTED_LYFT = {"dufomap": "49.9", "m_detector": "22.6", "hmm_mos": "27.7"}
"""The same on `lyft_5hz`, nothing tuned on it but M-detector's field of view and time between scans."""
OFF = 0.03
"""Share of the way by which the poses of a bad drive are off."""
REFERENCES = {case.against for case in CASES.values()}
"""What other cases are measured against."""
NOTABLE = 0.5
"""Points of IoU that a case or a change costs where it has a row of its own."""


def percent(value: float | None) -> str:
    """Return a ratio in percent, a dash where it is not defined."""
    return "-" if value is None else f"{100 * value:.1f}"


def ratios(row: Row) -> list[str]:
    """Return IoU, precision and recall in percent."""
    return [percent(row.get(key)) for key in ("iou", "precision", "recall")]


def has_movers(row: Row) -> bool:
    """Whether anything moves there, to anyone's knowledge: IoU has a meaning."""
    return row["true_points"] + row["missed_points"] > 0


def is_still(row: Row) -> bool:
    """Whether it is known that nothing moves there: false points count."""
    return row.get("scored_points", row.get("points", 0)) > 0 and not has_movers(row)


def part_of(row: Row, place: int) -> str:
    """Return scenario (0), sensor (1), scans (2) or seed (3) of a simulated recording; its name, of another one."""
    parts = row["recording"].partition("@")[0].split(":")
    return parts[place] if len(parts) == 4 else row["recording"]


def sensor_of(row: Row) -> str:
    """Return the sensor of a simulated recording, nothing of another one."""
    return part_of(row, 1) if row["recording"].count(":") >= 3 else ""


def case_of(row: Row) -> str:
    """Return how a recording is kept."""
    return row["recording"].partition("@")[2]


def mean_iou(rows: Iterable[Row]) -> float:
    """Return the mean IoU of recordings in which something moves, nan of none."""
    ious = [row["iou"] for row in rows if has_movers(row)]
    return float(np.mean(ious)) if ious else float("nan")


def _names(rows: list[Row], of: Callable[[Row], str]) -> list[str]:
    return list(dict.fromkeys(map(of, rows)))


def _with_false(row: Row) -> str:
    iou = f"{percent(row['iou'])} " if has_movers(row) else ""
    return f"{iou}({row['false_points']:,})"


def presets(rows: list[Row]) -> Lines:
    """Return one row a preset."""
    return [["preset", "IoU", "precision", "recall"], *([f"`{row['method']}`", *ratios(row)] for row in rows)]


def methods_of_worlds(rows: list[Row]) -> Lines:
    """Return one row a method: means over worlds in which something moves, the worst; false points elsewhere."""
    lines = [["method", "mean IoU", "precision", "recall", "worst world", "false points a scan where nothing moves"]]
    for method in _names(rows, lambda row: row["method"]):
        own = [row for row in rows if row["method"] == method]
        moving, still = [r for r in own if has_movers(r)], [r for r in own if not has_movers(r)]
        means = [percent(float(np.mean([row[key] or 0.0 for row in moving]))) for key in ("iou", "precision", "recall")]
        worst = min(moving, key=lambda row: row["iou"])
        false = sum(row["false_points"] / row["scans"] for row in still)
        title = f"`{method}`" if method in ("paper", "default") else own[0]["title"]
        lines.append([title, *means, f"{percent(worst['iou'])} `{part_of(worst, 0)}`", f"{false:.1f}"])
    return lines


def methods_of_drive(rows: list[Row]) -> Lines:
    """Return one row a method: scores, what its authors' code reaches, cost."""
    lines = [["method", "IoU", "precision", "recall", "reported", "s/scan", "CPU s/scan", "peak MB"]]
    for row in rows:
        is_alone = (row.get("cores_of_others") or 0.0) <= 0.1
        cost = [
            f"{'' if is_alone else '< '}{row['seconds_per_scan']:.2f}",
            "" if row["cpu_seconds_per_scan"] is None else f"{row['cpu_seconds_per_scan']:.2f}",
            "" if row["peak_mb"] is None else f"{row['peak_mb']:.0f}",
        ]
        lines.append([row["title"], *ratios(row), REPORTED.get(row["method"], ""), *cost])
    return lines


def rivals(rows: list[Row]) -> Lines:
    """Return one row a method, one column a recording: IoU, and in brackets what its authors' code reaches there."""
    recordings = _names(rows, lambda row: row["recording"])
    reported = {"kitti_0005": REPORTED, "lyft_5hz": REPORTED_LYFT}
    lines = [["method", *(f"`{name.rstrip('/').rpartition('/')[2]}`" for name in recordings)]]
    for method in _names(rows, lambda row: row["method"]):
        own = {row["recording"]: row for row in rows if row["method"] == method}
        theirs = [reported.get(name, {}).get(method) for name in recordings]
        ours = [percent(own[name]["iou"]) if name in own else "" for name in recordings]
        cells = [f"{a} ({b})" if b else a for a, b in zip(ours, theirs, strict=True)]
        lines.append([next(iter(own.values()))["title"], *cells])
    return lines


def gate(rows: list[Row], calibration: dict[str, list[float]] | None = None) -> Lines:
    """Return one row a world, one column a sensor: IoU, and false points; then means, cost and calibration."""
    sensors, seeds = _names(rows, sensor_of), _names(rows, lambda row: part_of(row, 3))
    lines = [["world", *sensors]]
    for seed in seeds:
        for world in _names(rows, lambda row: part_of(row, 0)):
            cells = [
                next((_with_false(r) for r in rows if [part_of(r, k) for k in (0, 1, 3)] == [world, s, seed]), "")
                for s in sensors
            ]
            lines.append([f"`{world}`" + (f" {seed}" if len(seeds) > 1 else ""), *cells])
    by_sensor = [[row for row in rows if sensor_of(row) == sensor] for sensor in sensors]
    lines.append(["**mean**", *(f"**{percent(mean_iou(some))}**" for some in by_sensor)])
    seconds = [sum(r["cpu_seconds"] for r in some) / sum(r["scans"] for r in some) for some in by_sensor]
    lines.append(["processor seconds a scan", *(f"{value:.2f}" for value in seconds)])
    lines.append(["peak memory, MB", *(f"{max(row['peak_mb'] or 0 for row in some):.0f}" for some in by_sensor)])
    if calibration:
        for k, kind in ((1, "moving"), (0, "static")):
            lines.append([f"calibration error, {kind}", *(f"{calibration[sensor][k]:.3f}" for sensor in sensors)])
    return lines


def recordings(rows: list[Row]) -> Lines:
    """Return one row a recording: IoU where there is truth, the share called moving; cases of one in a row together."""
    lines, cases = [["recording", "IoU", "points moving"]], {}
    for row in rows:
        if case_of(row):
            cases.setdefault(row["recording"].partition("@")[0], []).append(row)
            continue
        share = f"{100 * row['called_moving'] / max(row['points'], 1):.4f} %"
        lines.append([row["recording"], percent(row["iou"]) if has_movers(row) else "", share])
    for name, own in cases.items():
        worst = min(own, key=lambda row: row["iou"])
        ious = f"{percent(float(np.median([row['iou'] for row in own])))}; worst {percent(worst['iou'])}"
        lines.append([f"{name}, kept in {len(own)} other ways: median", f"{ious} ({case_of(worst)})", ""])
    return lines


def jitter(rows: list[Row]) -> Lines:
    """Return one row a recording: median, worst and best over the seeds by which its stamps are off."""
    lines = [["recording", "runs", "median IoU", "worst", "best"]]
    for name in _names(rows, lambda row: row["recording"].partition("~")[0]):
        ious = [row["iou"] for row in rows if row["recording"].partition("~")[0] == name]
        figures = (float(np.median(ious)), min(ious), max(ious))
        lines.append([name, str(len(ious)), *map(percent, figures)])
    return lines


def robustness(rows: list[Row]) -> Lines:
    """Return one row a case: IoU, and how far it is from that of the recording as it is."""
    plain = next(row["iou"] for row in rows if case_of(row) == "as it is")
    return [
        ["", "IoU", "change"],
        *([case_of(row), percent(row["iou"]), f"{100 * (row['iou'] - plain):+.1f}"] for row in rows),
    ]


def conventions(rows: list[Row]) -> Lines:
    """Return one row a case that costs something: points of IoU lost on the mean, and in the worst world.

    A case is measured against the one that its `against` names.
    """
    found = {(case_of(row), *(part_of(row, k) for k in (0, 1))): row for row in rows}
    lines, others = [], []
    for case in _names(rows, case_of):
        against = CASES[case].against
        if case in REFERENCES or against not in _names(rows, case_of):
            continue
        lost = {key[1:]: found[against, *key[1:]]["iou"] - found[key]["iou"] for key in found if key[0] == case}
        mean = 100 * float(np.mean(list(lost.values())))
        worst = max(lost, key=lambda key: lost[key])
        line = [case, f"{mean:.1f}", f"{100 * lost[worst]:+.1f} {' '.join(worst)}"]
        (lines if mean >= NOTABLE else others).append(line)
    return notable_conventions([["", "mean", "worst world"], *lines, *others])


def notable_conventions(lines: Lines) -> Lines:
    """Return the heading and the rows that cost NOTABLE points on the mean; in one row, how many others there are."""
    n = lines[0].index("mean")
    cases = [line for line in lines[1:] if line[0] not in REFERENCES]
    rest = [line for line in cases if _number(line[n]) < NOTABLE]
    kept = [[line[0], *line[n : n + 2]] for line in cases if _number(line[n]) >= NOTABLE]
    worst = max((_number(line[n]) for line in rest), default=0.0)
    said = [f"the other {len(rest)}", f"{worst:.1f} at most", ""]
    return [["", *lines[0][n : n + 2]], *kept, *([said] if rest else [])]


def scores_of_sensors(lines: Lines) -> Lines:
    """Return sensor, times, IoU and false points of what `other_sensors` made when it told more."""
    return [line[:5] for line in lines]


def _number(text: str) -> float:
    return float(text.rstrip(" !") or "nan")


def other_sensors(rows: list[Row]) -> Lines:
    """Return one row a sensor and kind of times: mean and worst IoU, false points."""
    lines = [["sensor", "times in the files", "mean IoU", "worst", "false points"]]
    for key in dict.fromkeys((sensor_of(row), case_of(row)) for row in rows):
        own = [row for row in rows if (sensor_of(row), case_of(row)) == key]
        worst = min(row["iou"] for row in own if has_movers(row))
        cells = [percent(mean_iou(own)), percent(worst), f"{sum(row['false_points'] for row in own):,}"]
        lines.append([key[0], "yes" if "times" in key[1] else "no", *cells])
    return lines


def ablation(rows: list[Row]) -> Lines:
    """Return one row a change: points of IoU it costs each sensor on the mean, most in one world, false points."""
    found = {(row.get("change", ""), row["recording"]): row for row in rows}
    sensors, lines = _names(rows, sensor_of), []
    for change in _names(rows, lambda row: row.get("change", "")):
        own = [row for row in rows if row.get("change", "") == change]
        lost = {r["recording"]: 100 * (found["", r["recording"]]["iou"] - r["iou"]) for r in own if has_movers(r)}
        by_sensor = [
            f"{np.mean([lost[r['recording']] for r in own if has_movers(r) and sensor_of(r) == sensor]):+.2f}"
            for sensor in sensors
        ]
        most = [
            f"{sign * lost[name]:.1f} {name.split(':')[0]}"
            for sign, name in ((1, max(lost, key=lost.__getitem__)), (-1, min(lost, key=lost.__getitem__)))
        ]
        lines.append([change or "everything", *by_sensor, *most, f"{sum(row['false_points'] for row in own):,}"])
    return notable_changes([["", *sensors, "most lost", "most won", "false points"], *lines])


def notable_changes(lines: Lines) -> Lines:
    """Return the rows that cost or gain NOTABLE points on a sensor's mean; in one row, how many others there are."""
    n = lines[0].index("most lost")
    kept, rest = [], []
    for line in lines[1:]:
        is_notable = line[0] == "everything" or any(abs(float(cell)) >= NOTABLE for cell in line[1:n])
        (kept if is_notable else rest).append(line)
    said = [[f"the other {len(rest)}: below {NOTABLE}", *[""] * (len(lines[0]) - 1)]]
    return [lines[0], *kept, *(said if rest else [])]


def ablation_odometry(rows: list[Row]) -> Lines:
    """Return one row a part that is left out: drives that are off, in silence, with scans missing; the others."""
    heading = ["without", "drives off by more than 3 %", "of these, scans missing", "not warned of"]
    lines = [[*heading, "mean of the others"]]
    for change in _names(rows, lambda row: row.get("change", "")):
        own = [row for row in rows if row.get("change", "") == change]
        bad, good = [r for r in own if r["off"] > OFF], [r["off"] for r in own if r["off"] <= OFF]
        missing, silent = sum(r["missing"] > 0 for r in bad), sum(not r["said"] for r in bad)
        mean = f"{100 * float(np.mean(good)):.2f} %" if good else "-"
        lines.append([change or "(nothing)", f"{len(bad)} of {len(own)}", str(missing), str(silent), mean])
    return lines


def trust(rows: list[Row]) -> Lines:
    """Return the drives that are off or warned of, one by one; the others in one row."""
    lines, others = [["drive", "off by", "warned"]], []
    for row in sorted(rows, key=lambda row: -row["off"]):
        if row["off"] > OFF or row["said"]:
            lines.append([row["recording"], f"{100 * row['off']:.1f} %", "yes" if row["said"] else "no"])
        else:
            others.append(row["off"])
    return [*lines, [f"the other {len(others)}", f"{100 * max(others, default=0.0):.1f} % at most", "no"]]


def drift(rows: list[Row]) -> Lines:
    """Return errors of the odometry in percent, and how thick walls come out."""
    lines = [["recording", "10 m", "5 s", "walls, cm"]]
    for row in rows:
        walls = [row["walls_m"], row["walls_reference_m"]]
        thick = " / ".join("-" if metres is None else f"{100 * metres:.1f}" for metres in walls)
        lines.append([row["recording"], *(_errors(row[over]) for over in ("10 m", "5 s")), thick])
    return lines


def _errors(found: dict[str, float] | None) -> str:
    return "-" if found is None else f"{found['mean']:.2f} / {found['max']:.2f}"


def stages(rows: list[Row]) -> Lines:
    """Return one row a stage, one column a preset and length of the recording; then processor time and memory."""
    lines = [["stage", *(f"`{row['method']}`, {row['scans']} scans" for row in rows)]]
    for stage in rows[0]["seconds_per_scan"]:
        lines.append([stage, *(f"{row['seconds_per_scan'][stage]:.3f} s" for row in rows)])
    lines.append(["processor time", *(f"{row['cpu_seconds_per_scan']:.3f} s" for row in rows)])
    return [*lines, ["peak memory", *(f"{row['peak_mb']:.0f} MB" for row in rows)]]


def odometry_speed(rows: list[Row]) -> Lines:
    """Return one row a program: milliseconds a scan."""
    cells = ([r["method"], f"{r['mean_ms']:.1f}", "-" if r["cpu_ms"] is None else f"{r['cpu_ms']:.1f}"] for r in rows)
    return [["odometry", "ms a scan", "CPU ms"], *cells]


def online(rows: list[Row]) -> Lines:
    """Return one row a lag."""
    lines = [["lag", "IoU", "precision", "recall", "not known", "median, p99 of a push", "scans/s", "peak MB"]]
    for row in rows:
        cost = [f"{row['median_ms']:.0f}, {row['p99_ms']:.0f} ms", f"{row['scans_a_second']:.1f}"]
        shares = [*ratios(row), f"{percent(row['unlabeled'])} %"]
        lines.append([f"{row['lag']:g} s", *shares, *cost, f"{row['peak_mb']:.0f}"])
    return lines


def lags(rows: list[Row]) -> Lines:
    """Return one row a recording: IoU at each lag, false points where nothing moves; last, means over worlds."""
    named = {(row["recording"], row["lag"]): row for row in rows}
    columns = _names(rows, lambda row: row["lag"])
    lines = [["recording", *(lag if lag == "all" else f"{lag:g} s" for lag in columns)]]
    for name in _names(rows, lambda row: row["recording"]):
        cells = (named.get((name, lag)) for lag in columns)
        lines.append([f"`{name}`", *("" if row is None else _with_false(row) for row in cells)])
    for part, title in (("", "worlds, all scans"), ("start_", "worlds, first ten scans")):
        of_lag = ([row for row in rows if row["lag"] == lag and sensor_of(row)] for lag in columns)
        ious = ([row[f"{part}iou"] for row in own if row[f"{part}iou"] is not None] for own in of_lag)
        lines.append([f"{title}, mean", *(percent(float(np.mean(own)) if own else None) for own in ious)])
    for title, of in (("departures, metres: median", 50), ("worst tenth", 90)):
        found = ([one["metres"] for row in rows if row["lag"] == lag for one in row["departures"]] for lag in columns)
        far = ([np.inf if metres is None else metres for metres in own] for own in found)
        lines.append([title, *(f"{np.percentile(own, of, method='higher'):.2f}" if own else "" for own in far)])
    return lines


def networks(rows: list[Row]) -> Lines:
    """Return one row a network."""
    return [
        ["method", "IoU", "precision", "recall"],
        *([row["method"], *ratios(row)] for row in rows[0]["scores"]),
    ]


def labels_of_networks(rows: list[Row]) -> Lines:
    """Return one row a kind of labels, one column a recording: IoU's mean over seeds, the least and the greatest."""
    tests = list(rows[0]["scores"])
    lines = [["labels", "networks", *(f"`{test}`" for test in tests)]]
    for labels in _names(rows, lambda row: row["labels"]):
        own = [row["scores"] for row in rows if row["labels"] == labels]
        ious = [[scores[test]["iou"] or 0.0 for scores in own] for test in tests]
        cells = (f"{percent(float(np.mean(some)))} ({percent(min(some))} to {percent(max(some))})" for some in ious)
        lines.append([labels, str(len(own)), *cells])
    return lines


def fine_tuning(rows: list[Row]) -> Lines:
    """Return one column for each number of epochs of which a network was kept, and one for the best epoch."""
    curves, scored = rows[0]["curves"], {row["method"]: row["iou"] for row in rows[0]["scores"]}
    epochs = sorted(map(int, curves["test"]))
    tuned, retrained = (_over_epochs(curves["validation"][name], epochs) for name in ("fine-tuned", "retrained"))
    best = [percent(scored[f"LMNet + ours, {name}"]) for name in ("fine-tuned", "retrained")]
    tested = [percent(curves["test"][str(n)]) for n in epochs]
    return [
        ["epochs in the other environment", *map(str, epochs), "best"],
        ["fine-tuned, test recordings", *tested, best[0]],
        ["fine-tuned, validation scans", *tuned],
        ["retrained, test recordings", *[""] * len(epochs), best[1]],
        ["retrained, validation scans", *retrained],
    ]


def _over_epochs(curve: list[float], epochs: list[int]) -> list[str]:
    return [*(percent(curve[n]) if n < len(curve) else "" for n in epochs), percent(max(curve))]


def shipped_network(rows: list[Row]) -> Lines:
    """Return one row a recording: scores where something moves in it, and the share of points called moving."""
    lines = [["recording", "IoU", "precision", "recall", "points moving"]]
    for row in rows:
        share = f"{100 * row['called_moving'] / max(row['points'], 1):.2f} %"
        lines.append([row["recording"], *(ratios(row) if has_movers(row) else ["", "", ""]), share])
    return lines


def network_speed(rows: list[Row]) -> Lines:
    """Return median and 99th percentile of the milliseconds of each stage."""
    lines = [["engine", "image", "points a scan", *rows[0]["milliseconds"], "scans/s", "CPU ms"]]
    for row in rows:
        cells = [f"{ms['median']:.1f} / {ms['p99']:.1f}" for ms in row["milliseconds"].values()]
        rates = [f"{row['scans_per_second']:.1f}", f"{row['cpu_milliseconds']:.0f}"]
        lines.append([row["engine"], row["image"], f"{row['points']:,}", *cells, *rates])
    return lines


def fleet(rows: list[Row]) -> Lines:
    """Return one row a number of recordings and kind of workers."""
    heading = ["workers", "recordings", "wall s", "CPU s per scan", "busy", "a worker waits between two"]
    lines = [[*heading, "memory, first quarter -> all"]]
    for row in rows:
        kind = (
            "Ray, two machines of one core"
            if row["what"] == "ray"
            else ("one process", "two processes")[row["workers"] - 1]
        )
        cells = [f"{row['wall_s']:.1f}", f"{row['cpu_per_scan_s']:.3f}", f"{100 * row['busy']:.0f} %"]
        memory = f"{row['peak_mb_first_quarter']:.0f} -> {row['peak_mb']:.0f} MB"
        lines.append([kind, str(row["recordings"]), *cells, f"{row['overhead_per_recording_s']:.2f} s", memory])
    return lines
