"""Seconds per scan and peak memory of every stage, on one recording and on the same recording made longer.

    python benchmarks/speed.py RECORDING [--preset paper] [--repeat 3] [--workers 0] [--json FILE]

The longer recording drives forth and back over the same scans, so that it moves on without a jump. Memory is the
proportional set size of this process and its workers, sampled five times a second.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import threading
import time
from pathlib import Path

import psutil
from rich.console import Console
from rich.table import Table

from automos import Workspace, label, load_settings, open_sequence
from automos.core.scan import Scan, Sequence


class ForthAndBack(Sequence):
    """The first `n` scans of a sequence driven forth, back, forth, ..."""

    def __init__(self, inner: Sequence, n: int):
        self._inner, self._n, self.name = inner, n, f"{inner.name}, {n} scans"

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: int) -> Scan:
        lap, at = divmod(index, len(self._inner))
        return self._inner[at if lap % 2 == 0 else len(self._inner) - 1 - at]


class MemoryWatch(threading.Thread):
    """Peak memory of this process and its children, by stage."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.stage, self.peak, self._done = "start", {}, threading.Event()

    def run(self) -> None:
        me = psutil.Process()
        while not self._done.wait(0.2):
            total = 0
            for process in [me, *me.children(recursive=True)]:
                try:
                    total += process.memory_full_info().pss
                except (psutil.Error, AttributeError):
                    continue
            self.peak[self.stage] = max(self.peak.get(self.stage, 0), total)

    def finish(self) -> None:
        self._done.set()
        self.join()


def measure(sequence: Sequence, preset: str, workers: int) -> dict:
    """Return seconds per scan and peak MB by stage, and in all."""
    watch = MemoryWatch()
    watch.start()

    def follow(stage: str, done: int, total: int) -> None:
        watch.stage = stage

    with tempfile.TemporaryDirectory() as folder:
        cpu, start = cpu_seconds(), time.perf_counter()
        result = label(
            sequence, load_settings(preset), workspace=Workspace(Path(folder)), workers=workers, progress=follow
        )
        wall = time.perf_counter() - start
        moving = sum(int((result.labels(i) == 251).sum()) for i in range(len(sequence)))
    watch.finish()
    n = len(sequence)
    return {
        "recording": sequence.name,
        "preset": preset,
        "scans": n,
        "seconds_per_scan": {k: v / n for k, v in result.seconds.items()} | {"all": wall / n},
        "cpu_seconds_per_scan": (cpu_seconds() - cpu) / n,
        "peak_mb": {k: v / 1e6 for k, v in watch.peak.items()} | {"all": max(watch.peak.values()) / 1e6},
        "moving_points": moving,
    }


def _megabytes(peak: float | None) -> str:
    return "        –" if peak is None else f"{peak:6.0f} MB"  # over before memory was looked at


def cpu_seconds() -> float:
    """Return the processor seconds of this process and its children so far."""
    me = psutil.Process()
    return sum(sum(p.cpu_times()[:2]) for p in [me, *me.children(recursive=True)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--preset", default="default")
    parser.add_argument("--repeat", type=int, default=1, help="also measure a recording this many times as long")
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    sequence = open_sequence(arguments.recording)
    # Compiled kernels come from a cache that the first run of all fills; it is not what is measured.
    measure(ForthAndBack(sequence, 12), arguments.preset, arguments.workers)
    rows = [
        measure(ForthAndBack(sequence, times * len(sequence)), arguments.preset, arguments.workers)
        for times in sorted({1, arguments.repeat})
    ]
    table = Table(title=f"preset {arguments.preset}: seconds per scan, peak MB")
    table.add_column("stage")
    for row in rows:
        table.add_column(row["recording"], justify="right")
    for stage in rows[0]["seconds_per_scan"]:
        cells = [f"{row['seconds_per_scan'][stage]:.3f} s  {_megabytes(row['peak_mb'].get(stage))}" for row in rows]
        table.add_row(stage, *cells)
    table.add_row("CPU, all cores", *(f"{row['cpu_seconds_per_scan']:.3f} s            " for row in rows))
    Console().print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
