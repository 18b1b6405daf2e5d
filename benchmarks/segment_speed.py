"""Milliseconds per scan of the online network, stage by stage: median and 99th percentile.

    python benchmarks/segment_speed.py RECORDING [--weights FILE ...] [--engine openvino] [--scans 100] [--threads 2]
                                       [--json FILE]
    python benchmarks/segment_speed.py RECORDING --size 64 2048 32 --device gpu     an untrained network of that size

Every stage from the scan in memory to its labels: odometry, image (projection and residuals), network, clean-up. The
first scans, during which kernels are compiled and sweep timing is found out, do not count.
CPU ms are those of all threads; they say what a scan costs where other work shares the machine.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from automos import load_settings, open_sequence
from automos.core.scan import Scan
from automos.network.deployed import Deployed, load_network
from automos.network.online import STAGES, OnlineSegmenter
from automos.network.segment import latencies, open_network
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import ImageSettings, ModelSettings, Settings

WARM_UP = 10
"""Scans that do not count."""


def measure(scans: list[Scan], network: Deployed, settings: Settings) -> dict:
    """Return median and p99 of every stage in ms, and scans a second over all."""
    segmenter = OnlineSegmenter(network, settings, timing=SweepTiming())
    for scan in scans[:WARM_UP]:
        segmenter.step(scan)
    for stage in STAGES:
        segmenter.seconds[stage].clear()
    n, start, cpu = len(scans) - WARM_UP, time.perf_counter(), time.process_time()
    for scan in scans[WARM_UP:]:
        segmenter.step(scan)
    rate, cpu = n / (time.perf_counter() - start), (time.process_time() - cpu) / n
    return {
        "engine": network.engine,
        "image": f"{network.image.height} x {network.image.width}",
        "points": int(np.mean([len(scan) for scan in scans])),
        "scans_per_second": rate,
        "cpu_milliseconds": 1e3 * cpu,
        "milliseconds": {stage: vars(value) for stage, value in latencies(segmenter).items()},
    }


def untrained(size: tuple[int, int, int], engine: str, device: str, threads: int) -> Deployed:
    """Return a network of random weights: height, width of its image, channels of its first layer."""
    from automos.network.checkpoint import Checkpoint, save_checkpoint
    from automos.network.export import export_onnx
    from automos.network.model import LMNet

    image, model = ImageSettings(height=size[0], width=size[1]), ModelSettings(channels=size[2])
    checkpoint = Checkpoint(LMNet(image, model).eval(), image, model)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "untrained.pt"
        save_checkpoint(path, checkpoint)
        if engine not in ("auto", "torch"):
            path = path.with_suffix(".onnx")
            export_onnx(checkpoint, path)
        return load_network(path, engine, device, threads)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--weights", type=Path, nargs="*", help="default: the network that came along")
    parser.add_argument("--size", type=int, nargs=3, metavar=("HEIGHT", "WIDTH", "CHANNELS"))
    parser.add_argument("--engine", default="auto")
    parser.add_argument("--device", default="auto")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--scans", type=int, default=100)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    online = (arguments.engine, arguments.device, arguments.threads)
    settings = load_settings("default")
    sequence = open_sequence(arguments.recording)
    scans = [sequence[i] for i in range(min(arguments.scans + WARM_UP, len(sequence)))]
    if arguments.size:
        networks = [untrained(tuple(arguments.size), *online)]
    else:
        networks = [open_network(weights, *online) for weights in arguments.weights or [None]]
    rows = [measure(scans, network, settings) for network in networks]
    table = Table("network", "points", "scans/s", "CPU ms", *STAGES, "all", title="ms a scan, median / p99")
    for row in rows:
        cells = [f"{ms['median']:.1f} / {ms['p99']:.1f}" for ms in row["milliseconds"].values()]
        rate = f"{row['scans_per_second']:.1f}"
        cpu = f"{row['cpu_milliseconds']:.0f}"
        table.add_row(f"{row['image']}, {row['engine']}", f"{row['points']:,}", rate, cpu, *cells)
    Console(width=160).print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
