"""What many recordings cost: by their number, with one and two workers, and on a Ray cluster of two machines in one.

    python benchmarks/scale.py [--recordings 64] [--scans 20] [--cache FOLDER] [--skip-ray] [--json FILE]

Recordings are simulated once and kept in the cache. Every worker has one core. Wall time counts from the call to the
last label, the start of workers included; busy is the share of it that they spent on recordings; overhead is what a
worker waits from one recording to the next, once all are there; CPU is that of the workers. The labels of all runs are
compared byte for byte.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
import time
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from automos import load_settings
from automos.core.parallel import map_in_order
from automos.fleet.executors import Executor
from automos.fleet.label import Resources, label_fleet
from automos.fleet.local_pool import LocalPool
from automos.fleet.ray_cluster import RayCluster
from automos.fleet.sources import find_all
from automos.fleet.status import read_status
from automos.simulation import simulate, write


def make_recording(folder: Path, scans: int, seed: int) -> None:
    """Simulate a recording where it is not there yet."""
    write(simulate("city", "VLP-16", scans, seed=seed), folder / f"city-{scans}-{seed:03d}")


def make_recordings(folder: Path, n: int, scans: int) -> list:
    """Return `n` recordings of `scans` scans each, simulated where they are not there yet."""
    list(map_in_order(partial(make_recording, folder, scans), range(n), workers=0))
    return [one for one in find_all(str(folder)) if one.name.startswith(f"city-{scans}-")][:n]


def measure(recordings: list, what: str, make: callable, workers: int) -> dict:
    """Return what labelling `recordings` costs."""
    with tempfile.TemporaryDirectory() as out:
        start = time.perf_counter()
        means = Resources(work=Path(out) / "work", workers=workers)
        outcome = label_fleet(recordings, out, load_settings("default"), means, executor=lambda means: make())
        wall = time.perf_counter() - start
        status = read_status(out)
        labels = hashlib.sha256()
        for path in sorted(Path(out).rglob("predictions/*.label")):
            labels.update(path.read_bytes())
    assert not outcome.failed, outcome.failed
    units = sorted(status.units, key=lambda unit: unit["ended"])
    scans = sum(row["scans"] for row in status.recordings)
    quarter = max(len(units) // 4, 1)
    return {
        "what": what,
        "recordings": len(recordings),
        "workers": workers,
        "wall_s": wall,
        "wall_per_recording_s": wall / len(recordings),
        "cpu_per_scan_s": sum(unit["cpu_seconds"] for unit in units) / scans,
        "busy": sum(unit["seconds"] for unit in units) / (workers * wall),
        "overhead_per_recording_s": overhead(units, workers),
        "peak_mb_first_quarter": max(unit["peak_mb"] for unit in units[:quarter]),
        "peak_mb": max(unit["peak_mb"] for unit in units),
        "labels": labels.hexdigest(),
    }


def overhead(units: list[dict], workers: int) -> float:
    """Return seconds that a worker waits between two of `units`: from when all have ended one to when the last begins.

    Units are in order of their end.
    """
    spans = [(unit["ended"] - unit["seconds"], unit["ended"]) for unit in units]
    first, last = spans[min(workers, len(spans)) - 1][1], max(start for start, _ in spans)
    at_work = sum(max(min(end, last) - max(start, first), 0.0) for start, end in spans)
    waits = sum(first < start <= last for start, _ in spans)
    return max(workers * (last - first) - at_work, 0.0) / waits if waits else 0.0


def ray_cluster() -> tuple[object, str]:
    """Return a started cluster of two machines of one core each, and its address."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    cluster.add_node(num_cpus=1)
    return cluster, cluster.address


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=64)
    parser.add_argument("--scans", type=int, default=20)
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "automos-scale-benchmark")
    parser.add_argument("--skip-ray", action="store_true")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    recordings = make_recordings(arguments.cache, arguments.recordings, arguments.scans)

    def pool(workers: int) -> callable:
        return lambda: LocalPool(workers, workers)

    measure(recordings[:2], "warm-up", pool(2), 2)  # fills the compiler's cache
    sizes = sorted({n for n in (8, 16, 32, 64) if n < len(recordings)} | {len(recordings)})
    rows = [measure(recordings, "pool", pool(1), 1)]
    rows += [measure(recordings[:n], "pool", pool(2), 2) for n in reversed(sizes)]
    if not arguments.skip_ray:
        cluster, address = ray_cluster()

        def make() -> Executor:
            return RayCluster(address, 10**9)

        rows.append(measure(recordings, "ray", make, 2))
        cluster.shutdown()
    table = Table(title=f"{arguments.scans} scans of a VLP-16 each, preset default")
    headings = ("", "recordings", "workers", "wall s", "s/recording", "CPU s/scan", "busy", "overhead s", "peak MB")
    for heading in headings:
        table.add_column(heading, justify="right")
    for row in rows:
        peak = f"{row['peak_mb_first_quarter']:.0f} -> {row['peak_mb']:.0f}"
        numbers = (row["wall_s"], row["wall_per_recording_s"], row["cpu_per_scan_s"], row["busy"])
        cells = (f"{number:.{digits}f}" for number, digits in zip(numbers, (1, 2, 3, 2), strict=True))
        table.add_row(
            row["what"], str(row["recordings"]), str(row["workers"]), *cells,
            f"{row['overhead_per_recording_s']:.3f}", peak,
        )  # fmt: skip
    Console(width=120).print(table)
    whole = [row for row in rows if row["recordings"] == len(recordings)]
    print(f"two workers are {whole[0]['wall_s'] / whole[1]['wall_s']:.2f} times as fast as one")
    print("labels of all runs are the same" if len({row["labels"] for row in whole}) == 1 else "LABELS DIFFER")
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
