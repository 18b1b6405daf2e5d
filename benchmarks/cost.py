"""Seconds and megabytes: of every stage, of the odometry beside its authors' own, of the online network, of a fleet."""

import hashlib
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from labels import WARM_UP, First, timed
from recordings import opened

from automos import Workspace, label, load_settings
from automos.baselines.comparison.cost import Effort
from automos.core.scan import Scan, Sequence
from automos.simulation import simulate, write


class ForthAndBack(Sequence):
    """The first `n` scans of a sequence driven forth, back, forth, ..., so that it moves on without a jump."""

    def __init__(self, inner: Sequence, n: int):
        self._inner, self._n, self.name = inner, n, f"{inner.name}, {n} scans"

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: int) -> Scan:
        lap, at = divmod(index, len(self._inner))
        return self._inner[at if lap % 2 == 0 else len(self._inner) - 1 - at]


def stages(recording: str, store: Path, method: str = "default", laps: int = 1, workers: int = 0) -> dict[str, Any]:
    """Return seconds a scan of every stage, processor seconds and peak memory of a recording driven so many times."""
    settings = load_settings(method)
    with opened(recording, store) as made, tempfile.TemporaryDirectory() as folder:
        sequence = ForthAndBack(made.sequence, laps * len(made.sequence))
        label(First(sequence, WARM_UP), settings, workers=workers)
        with Effort() as effort:
            result = label(sequence, settings, workspace=Workspace(Path(folder)), workers=workers)
            for i in range(len(sequence)):
                result.labels(i)
    n = len(sequence)
    return {
        "scans": n,
        "seconds_per_scan": {stage: spent / n for stage, spent in result.seconds.items()} | {"all": effort.seconds / n},
        "cpu_seconds_per_scan": effort.busy / n,
        "peak_mb": effort.peak / 1e6,
    }


def odometry(recording: str, store: Path, method: str) -> dict[str, Any]:
    """Return milliseconds a scan of the odometry: of a preset, or of `kiss-icp`, the package of its authors."""
    with opened(recording, store) as made:
        scans = [made.sequence[i] for i in range(len(made.sequence))]
        if method == "kiss-icp":
            from kiss_icp.config import KISSConfig
            from kiss_icp.kiss_icp import KissICP

            config = KISSConfig()
            config.mapping.voxel_size = 1.0
            theirs = KissICP(config)
            points = [(scan.points[scan.is_valid].astype(np.float64), np.zeros(0)) for scan in scans]
            spent = timed(partial(theirs.register_frame, *given) for given in points)
            spent, cpu = spent[WARM_UP:], None
        else:
            from automos.odometry.estimate import estimate_trajectory

            settings = load_settings(method).odometry
            estimate_trajectory(First(made.sequence, WARM_UP), settings)
            cpu, start = time.process_time(), time.perf_counter()
            estimate_trajectory(made.sequence, settings)
            spent = [1e3 * (time.perf_counter() - start) / len(scans)]
            cpu = 1e3 * (time.process_time() - cpu) / len(scans)
    return {"scans": len(scans), "mean_ms": float(np.mean(spent)), "cpu_ms": cpu}


def network(recording: str, store: Path) -> dict[str, Any]:
    """Return median and 99th percentile of every stage of the network that comes along, ms, and scans a second."""
    from automos.network.online import STAGES, OnlineSegmenter
    from automos.network.segment import latencies, open_network
    from automos.odometry.sweep_timing import SweepTiming

    deployed = open_network(None)
    segmenter = OnlineSegmenter(deployed, load_settings("default"), timing=SweepTiming())
    with opened(recording, store) as made:
        scans = [made.sequence[i] for i in range(min(len(made.sequence), 100))]
    for scan in scans[:WARM_UP]:
        segmenter.step(scan)
    for stage in STAGES:
        segmenter.seconds[stage].clear()
    start, cpu = time.perf_counter(), time.process_time()
    for scan in scans[WARM_UP:]:
        segmenter.step(scan)
    n = len(scans) - WARM_UP
    return {
        "engine": deployed.engine,
        "image": f"{deployed.image.height} x {deployed.image.width}",
        "points": int(np.mean([len(scan) for scan in scans])),
        "scans_per_second": n / (time.perf_counter() - start),
        "cpu_milliseconds": 1e3 * (time.process_time() - cpu) / n,
        "milliseconds": latencies(segmenter),
    }


def fleet(store: Path, what: str, workers: int, recordings: int, scans: int = 20) -> dict[str, Any]:
    """Return what many recordings cost, one core a worker; `what` is `pool`, or `ray`: two machines in one.

    Wall time counts from the call to the last label, the start of workers included; busy is the share of it that they
    spent on recordings; overhead is what a worker waits from one recording to the next, once all are there.
    """
    from automos.fleet.label import Resources, label_fleet
    from automos.fleet.local_pool import LocalPool
    from automos.fleet.ray_cluster import RayCluster
    from automos.fleet.sources import find_all
    from automos.fleet.status import read_status

    folder = store / "fleet"
    for seed in range(recordings):
        write(simulate("city", "VLP-16", scans, seed=seed), folder / f"city-{scans}-{seed:03d}")
    chosen = [one for one in find_all(str(folder)) if one.name.startswith(f"city-{scans}-")][:recordings]
    make: Callable[[], Any] = partial(LocalPool, workers, workers)
    if what == "ray":
        from ray.cluster_utils import Cluster

        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
        cluster.add_node(num_cpus=1)
        make = partial(RayCluster, cluster.address, 10**9)
    with tempfile.TemporaryDirectory() as out:
        start = time.perf_counter()
        means = Resources(work=Path(out) / "work", workers=workers)
        outcome = label_fleet(chosen, out, load_settings("default"), means, executor=lambda means: make())
        wall, status, labels = time.perf_counter() - start, read_status(out), hashlib.sha256()
        for path in sorted(Path(out).rglob("predictions/*.label")):
            labels.update(path.read_bytes())
    if outcome.failed:
        raise SystemExit(f"recordings failed: {outcome.failed}")
    units = sorted(status.units, key=lambda unit: unit["ended"])
    n_scans = sum(row["scans"] for row in status.recordings)
    return {
        "wall_s": wall,
        "cpu_per_scan_s": sum(unit["cpu_seconds"] for unit in units) / n_scans,
        "busy": sum(unit["seconds"] for unit in units) / (workers * wall),
        "overhead_per_recording_s": overhead(units, workers),
        "peak_mb_first_quarter": max(unit["peak_mb"] for unit in units[: max(len(units) // 4, 1)]),
        "peak_mb": max(unit["peak_mb"] for unit in units),
        "labels": labels.hexdigest(),
    }


def overhead(units: list[dict[str, Any]], workers: int) -> float:
    """Return seconds that a worker waits between two of `units`: from when all have ended one to when the last begins.

    Units are in order of their end.
    """
    spans = [(unit["ended"] - unit["seconds"], unit["ended"]) for unit in units]
    first, last = spans[min(workers, len(spans)) - 1][1], max(start for start, _ in spans)
    at_work = sum(max(min(end, last) - max(start, first), 0.0) for start, end in spans)
    waits = sum(first < start <= last for start, _ in spans)
    return max(workers * (last - first) - at_work, 0.0) / waits if waits else 0.0
