"""The method at several lags beside online rivals: IoU, milliseconds a scan and memory of each.

    python benchmarks/online.py RECORDING [--lags 0 0.5 1 2] [--rivals m_detector hmm_mos lmnet] [--json FILE]
    python benchmarks/online.py --world city HDL-64E 60 1 ...                            a simulated one instead

Every scan counts, the first ones too. Times are those of one `push`, from the scan in memory to its labels, odometry
included; scans a second those of `push_each`, from memory, as fast as it goes. The first scans, during which kernels
may be compiled, do not count for either. CPU ms are those of all threads.
Rivals get the poses that the method found at lag 0; their times leave the odometry out. LMNet has its own.
Each method runs in a process of its own, so that memory is its own.
"""

import argparse
import json
import multiprocessing
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from labels import First
from recordings import stored_world
from rich.console import Console
from rich.table import Table

from automos import Labeler, load_settings, open_sequence
from automos.baselines.comparison.cost import Effort
from automos.core.errors import MissingExtraError
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts, count
from automos.live.segment import stamped

WARM_UP = 12
"""Scans whose times do not count."""
Labelled = Iterator[tuple[int, npt.NDArray, float]]
"""Scan, labels (N,), and the milliseconds since the one before."""


def by_labeler(sequence: Sequence, lag: float, poses: list[npt.NDArray]) -> Labelled:
    """Yield the scans at some lag; their poses go to `poses`."""
    labeler = Labeler(load_settings("default"), lag=lag, is_compensated=sequence.is_compensated)
    for scan in stamped(sequence):
        start = time.perf_counter()
        given = labeler.push(scan)
        spent = 1e3 * (time.perf_counter() - start)
        for one in given:
            poses.append(one.pose)
            yield one.index, one.labels, spent
    for one in labeler.finish():
        poses.append(one.pose)
        yield one.index, one.labels, float("nan")


def scans_a_second(sequence: Sequence, lag: float) -> float:
    """Return how many scans a second `push_each` labels."""
    labeler = Labeler(load_settings("default"), lag=lag, is_compensated=sequence.is_compensated)
    begin = 0.0
    for i, _ in enumerate(labeler.push_each(list(stamped(sequence)))):
        begin = time.perf_counter() if i == WARM_UP else begin
    return (len(sequence) - 1 - WARM_UP) / (time.perf_counter() - begin)


def by_network(sequence: Sequence) -> Labelled:
    """Yield the scans as the network that came along labels them."""
    from automos.network.online import OnlineSegmenter
    from automos.network.segment import open_network

    segmenter = OnlineSegmenter(open_network(None), load_settings("default"), is_compensated=sequence.is_compensated)
    for i, scan in enumerate(stamped(sequence)):
        start = time.perf_counter()
        labels = segmenter.step(scan)
        yield i, labels, 1e3 * (time.perf_counter() - start)


def by_rival(sequence: Sequence, method: str, poses: npt.NDArray) -> Labelled:
    """Yield the scans as an online method that ours is compared with labels them, at given poses."""
    from automos.baselines.methods import BASELINES
    from automos.odometry.estimate import estimate_trajectory
    from automos.odometry.trajectory import SequenceFrames

    settings = load_settings("default")
    trajectory = estimate_trajectory(sequence, settings.odometry, poses)
    frames, start = SequenceFrames(sequence, trajectory), time.perf_counter()
    for i, is_moving in BASELINES[method].find_moving(frames, trajectory.stamps, settings, 0):
        spent = 1e3 * (time.perf_counter() - start)
        scan = sequence[i]
        labels = np.zeros(len(scan), np.uint8)
        labels[scan.is_valid] = np.where(is_moving, Label.MOVING, Label.STATIC)
        yield i, labels, spent
        start = time.perf_counter()


def measure(place: tuple[str, ...], n_scans: int, method: str, lag: float, poses: npt.NDArray | None) -> dict[str, Any]:
    """Return one row: scores, milliseconds, megabytes, and the poses found."""
    sequence = open_place(place, n_scans)
    found: list[npt.NDArray] = []
    if method == "automos":
        labelled = by_labeler(sequence, lag, found)
    else:
        labelled = by_network(sequence) if method == "lmnet" else by_rival(sequence, method, poses)
    counts, milliseconds, cpu = Counts(), [], time.process_time()
    with Effort() as effort:
        for i, labels, spent in labelled:
            truth = sequence.truth(i)
            counts += Counts() if truth is None else count(labels, truth)
            milliseconds.append(spent)
    cpu = 1e3 * (time.process_time() - cpu) / len(sequence)
    usual = np.array(milliseconds[WARM_UP:])
    usual = usual[np.isfinite(usual)]
    scores = counts.scores
    return {
        "method": method, "lag": lag, "scans": len(sequence), "iou": scores.iou, "precision": scores.precision,
        "recall": scores.recall, "unlabeled": scores.n_unlabeled / max(scores.n_points, 1),
        "median_ms": float(np.median(usual)) if len(usual) else None,
        "p99_ms": float(np.percentile(usual, 99)) if len(usual) else None,
        "cpu_ms": cpu, "peak_mb": effort.peak / 1e6,
        "scans_a_second": scans_a_second(sequence, lag) if method == "automos" else None,
        "poses": [pose.tolist() for pose in found],
    }  # fmt: skip


def open_place(place: tuple[str, ...], n_scans: int) -> Sequence:
    """Return the recording at a path, or the simulated world of a scenario, sensor, number of scans and seed."""
    if len(place) == 1:
        sequence: Sequence = open_sequence(Path(place[0]))
    else:
        store, scenario, sensor, n, seed = place
        sequence = stored_world(Path(store), scenario, sensor, int(n), int(seed))
    return First(sequence, n_scans) if n_scans else sequence


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", nargs="?", help="with truth")
    parser.add_argument("--world", nargs=4, metavar=("SCENARIO", "SENSOR", "SCANS", "SEED"))
    parser.add_argument("--lags", nargs="+", type=float, default=[0.0, 0.5, 1.0, 2.0])
    parser.add_argument("--rivals", nargs="*", default=["m_detector", "hmm_mos", "lmnet"])
    parser.add_argument("--scans", type=int, default=0, help="the first so many; 0: all")
    parser.add_argument("--store", default=str(Path(tempfile.gettempdir()) / "automos_worlds"))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    if (arguments.recording is None) == (arguments.world is None):
        parser.error("give a recording or a --world")
    place = (arguments.recording,) if arguments.world is None else (arguments.store, *arguments.world)
    jobs = [("automos", lag) for lag in sorted({0.0, *arguments.lags})] + [(rival, 0.0) for rival in arguments.rivals]
    rows, poses = [], None
    for method, lag in jobs:
        try:
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                row = pool.apply(measure, (place, arguments.scans, method, lag, poses))
        except MissingExtraError as missing:
            Console(stderr=True).print(f"{method} is left out: {missing}")
            continue
        found = np.array(row.pop("poses"))
        if method == "automos" and lag == 0.0:
            poses = np.linalg.inv(found[0]) @ found
            if 0.0 not in arguments.lags:
                continue
        rows.append(row)
        Console(stderr=True).print(row)
    Console(width=120).print(_table(rows, " ".join(place)))
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


def _table(rows: list[dict[str, Any]], title: str) -> Table:
    columns = ("method", "lag s", "IoU", "precision", "recall", "not known %", "ms", "scans/s", "CPU ms", "MB")
    table = Table(*columns, title=f"{title}: every scan; ms: median / p99 of one push")
    for row in rows:
        shares = [f"{100 * row[name]:.1f}" for name in ("iou", "precision", "recall", "unlabeled")]
        ms = "" if row["median_ms"] is None else f"{row['median_ms']:.0f} / {row['p99_ms']:.0f}"
        rate = "" if row["scans_a_second"] is None else f"{row['scans_a_second']:.1f}"
        cost = ms, rate, f"{row['cpu_ms']:.0f}", f"{row['peak_mb']:.0f}"
        table.add_row(row["method"], f"{row['lag']:g}", *shares, *cost)
    return table


if __name__ == "__main__":
    main()
