"""What the tables show of results about what stands beside the labels: see `jobs_beside_labels.py`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rows import Rows


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"


def networks(result: dict) -> Rows:
    rows = [["method", "IoU", "precision", "recall"]]
    for row in result["rows"]:
        rows.append([row["method"], *(_percent(row[key]) for key in ("iou", "precision", "recall"))])
    return rows


def fine_tuning(result: dict) -> Rows:
    """One column for each number of epochs of which a network was kept, and one for the best epoch."""
    curves, scored = result["curves"], {row["method"]: row["iou"] for row in result["rows"]}
    epochs = sorted(map(int, curves["test"]))
    tuned, retrained = (_over_epochs(curves["validation"][name], epochs) for name in ("fine-tuned", "retrained"))
    best = [_percent(scored[f"LMNet + ours, {name}"]) for name in ("fine-tuned", "retrained")]
    tested = [_percent(curves["test"][str(n)]) for n in epochs]
    return [
        ["epochs in the other environment", *map(str, epochs), "best"],
        ["fine-tuned, test recordings", *tested, best[0]],
        ["fine-tuned, validation scans", *tuned],
        ["retrained, test recordings", *[""] * len(epochs), best[1]],
        ["retrained, validation scans", *retrained],
    ]


def _over_epochs(curve: list[float], epochs: list[int]) -> list[str]:
    return [*(_percent(curve[n]) if n < len(curve) else "" for n in epochs), _percent(max(curve))]


def self_training(result: dict) -> Rows:
    """One row a recording: IoU, precision and recall of the labels, of the network, and of labels with it as a cue."""
    rounds = {
        "labels": "labels",
        "network": "network alone",
        "labels with the network": "labels with the network as a cue",
    }
    rows = [["recording", *rounds.values()]]
    for name, found in result.items():
        rows.append([f"`{name}`" if "_" in name else name, *(_triple(found[key]) for key in rounds)])
    return rows


def _triple(percent: list[float | None]) -> str:
    return " / ".join("-" if value is None else f"{value:.1f}" for value in percent)


def segment_speed(result: list[dict]) -> Rows:
    """One row a network: median and 99th percentile of the milliseconds of each stage."""
    names = {"image": "image: projection, residuals", "clean-up": "clean-up: kNN"}
    stages = [names.get(stage, stage) for stage in result[0]["milliseconds"]]
    rows = [["engine", "image", "points a scan", *stages, "scans/s", "CPU ms"]]
    for row in result:
        cells = [f"{ms['median']:.1f} / {ms['p99']:.1f}" for ms in row["milliseconds"].values()]
        rates = [f"{row['scans_per_second']:.1f}", f"{row['cpu_milliseconds']:.0f}"]
        rows.append([row["engine"], row["image"], f"{row['points']:,}", *cells, *rates])
    return rows


def shipped_network(result: dict) -> Rows:
    ratios = [_percent(result[key]) for key in ("iou", "precision", "recall")]
    return [["recording", "IoU", "precision", "recall"], [result["recording"], *ratios]]


def simulator_statistics(result: dict) -> Rows:
    """One row a figure; for each pair of recordings the real one's, the simulated one's, and their ratio."""
    heading, pairs = [""], list(result.values())
    for name in result:
        real, scenario = name.split(" / ")
        heading += [real, f"`{scenario}`", "ratio"]
    return [heading, *([key, *(cell for pair in pairs for cell in _beside(pair, key))] for key in pairs[0]["real"])]


def _beside(pair: dict, key: str) -> list[str]:
    real, simulated = pair["real"][key], pair["simulated"][key]
    ratio = "-" if not real else f"{simulated / real:.2f}"
    return ["-" if real is None else _rounded(real), _rounded(simulated), ratio]


def _rounded(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.4g}"


def reference_poses(result: dict) -> Rows:
    """One row a case: distances of both poses from the yardstick, and neighbours under each."""
    rows = [
        [
            "recording, time apart",
            "pairs that agree",
            "odometry off",
            "reference off",
            "within 10 cm, odometry",
            "reference",
        ]
    ]
    for name, row in result.items():
        agreed = f"{row['agreed']} of {row['pairs']}"
        off = [f"{row[key]:.2f} %" if row["agreed"] else "-" for key in ("odometry_percent", "reference_percent")]
        close = [f"{100 * row[key]:.1f} %" if row["agreed"] else "-" for key in ("close_odometry", "close_reference")]
        rows.append([name, agreed, *off, *close])
    return rows


def maps(result: dict) -> Rows:
    names = ("PR", "RR", "F1", "SA", "DA", "AA")
    return [
        ["labels of", *names],
        *([row["title"], *(_percent(row[name]) for name in names)] for row in result.values()),
    ]


PUBLIC_HMM_MOS = ["public implementation, its Apollo values", "75.1", "99.0", "75.7"]
"""Measured once, with KISS-ICP's poses."""


def hmm_mos(result: dict) -> Rows:
    (recording,) = result.values()
    ratios = [_percent(recording["methods"]["hmm_mos"][key]) for key in ("iou", "precision", "recall")]
    return [["", "IoU", "precision", "recall"], PUBLIC_HMM_MOS, ["ours", *ratios]]


def rivals_in_parts(prefix: str) -> Callable[[dict], Rows]:
    """One row a form of the method `prefix`, one column a part: IoU, precision, recall, and the false points."""

    def rows(result: dict) -> Rows:
        forms = {title: parts for title, parts in result.items() if title.startswith(prefix)}
        return [["", *next(iter(forms.values()))], *([t, *map(_of_part, parts.values())] for t, parts in forms.items())]

    return rows


def _of_part(row: dict) -> str:
    return f"{_percent(row['iou'])} ({_percent(row['precision'])} / {_percent(row['recall'])}), {row['false']:,} false"


def sampling(result: dict) -> Rows:
    """One row a world: precision and recall of all points, and how many intervals hold them."""
    rows = [["recording", "precision", "interval holds it", "recall", "interval holds it", "widths"]]
    for name, row in result.items():
        cells = [f(row, of) for of in ("precision", "recall") for f in (_true_ratio, _held)]
        wide = " and ".join(f"{100 * row['width'][of]:.0f}" for of in ("precision", "recall"))
        rows.append([name.rsplit("-v", 1)[0], *cells, f"{wide} points"])
    return rows


def _true_ratio(row: dict, of: str) -> str:
    return _percent(row["truth"][of])


def _held(row: dict, of: str) -> str:
    return f"{row['holds'][of]} of {row['samples']}"


def review_queue(result: dict) -> Rows:
    rows = [
        [
            "recording",
            "objects",
            "hold 95 % of the doubtful points",
            "the first 100 hold",
            "doubtful points",
            "wrong points",
        ]
    ]
    for name, row in result.items():
        wrong = "-" if row["wrong_points"] is None else f"{row['wrong_points']:,}"
        share = f"{100 * row['first_share']:.0f} %"
        rows.append(
            [name, f"{row['objects']:,}", f"{row['hold_95_percent']:,}", share, f"{row['doubtful_points']:,.0f}", wrong]
        )
    return rows


def review(result: dict[str, list[float]]) -> Rows:
    rows = [["", "middle", "95 of 100"]]
    for what, seconds in result.items():
        rows.append([what, f"{np.median(seconds):.3f} s", f"{np.percentile(seconds, 95):.3f} s"])
    return rows
