"""Milliseconds to read one scan of 64 beams from each format.

    python benchmarks/reading.py [--scans 10] [--repeat 3] [--json FILE]

The same simulated scans (x, y, z, intensity, time, ring) are written in every format and read back through
`automos.open_sequence`, in order, from a warm file cache, as the pipeline does. Formats whose package is not installed
are left out. The time is the median over all scans; each is read `--repeat` times and counts with its fastest.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from automos import open_sequence
from automos.core.array_sequence import ArraySequence
from automos.core.errors import MissingExtraError
from automos.results.run_files import RunFiles
from automos.simulation import simulate
from automos.writers import load_export
from automos.writers.point_columns import packed_rows, scan_columns

TARGET_MS = 10.0


class Unlabelled(RunFiles):
    """Scans to export that nobody labelled."""

    def __init__(self, sequence: ArraySequence):
        self.folder, self.sequence, self.names = Path(), sequence, sequence.names
        self._progress, self.deskewed = lambda name, done, total: None, False

    def labels(self, index: int, n_points: int) -> np.ndarray:
        return np.zeros(n_points, np.uint16)

    def instances(self, index: int, n_points: int) -> np.ndarray:
        return np.zeros(n_points, np.int64)


def write_bin(run: RunFiles, out: Path) -> None:
    (out / "velodyne").mkdir(parents=True)
    for i, name in enumerate(run.names):
        scan = run.scan(i)
        np.column_stack([scan.points, scan.intensity]).tofile(out / "velodyne" / f"{name}.bin")


def write_bin5(run: RunFiles, out: Path) -> None:
    out.mkdir(parents=True)
    for i, name in enumerate(run.names):
        scan = run.scan(i)
        np.column_stack([scan.points, scan.intensity, scan.ring]).astype(np.float32).tofile(out / f"{name}.bin")


def write_npy(run: RunFiles, out: Path) -> None:
    out.mkdir(parents=True)
    for i, name in enumerate(run.names):
        scan = run.scan(i)
        np.save(out / f"{name}.npy", packed_rows(scan_columns(scan, scan.points)))


def write_feather(run: RunFiles, out: Path) -> None:
    """Write an Argoverse 2 log whose vehicle is the sensor."""
    import pyarrow
    from pyarrow import feather

    (out / "sensors" / "lidar").mkdir(parents=True)
    (out / "calibration").mkdir()
    for i in range(len(run)):
        scan = run.scan(i)
        columns = {axis: scan.points[:, k].astype(np.float16) for k, axis in enumerate("xyz")}
        columns["intensity"] = np.clip(scan.intensity, 0, 255).astype(np.uint8)
        columns["laser_number"] = scan.ring.astype(np.uint8)
        columns["offset_ns"] = (1e9 * scan.time.astype(np.float64)).astype(np.int32)
        path = out / "sensors" / "lidar" / f"{round(1e9 * (1e9 + run.stamps[i]))}.feather"
        feather.write_feather(pyarrow.table(columns), path)
    at_origin = {f"q{a}": [float(a == "w")] for a in "xyzw"} | {f"t{a}_m": [0.0] for a in "xyz"}
    table = pyarrow.table({"sensor_name": ["up_lidar"], **at_origin})
    feather.write_feather(table, out / "calibration" / "egovehicle_SE3_sensor.feather")


def write_export(format: str) -> Callable[[RunFiles, Path], None]:
    return lambda run, out: load_export(format).write(run, out)


FORMATS: dict[str, tuple[str, str | None, Callable[[RunFiles, Path], None]]] = {
    "KITTI .bin": ("kitti", None, write_bin),
    "nuScenes .bin, 5 columns": ("bin5", "bin5", write_bin5),
    "NumPy .npy": ("npy", None, write_npy),
    "PCD, binary": ("pcd", None, write_export("pcd")),
    "PLY, binary": ("ply", None, write_export("ply")),
    "ROS 2 MCAP": ("log.mcap", None, write_export("mcap")),
    "Argoverse 2 .feather": ("av2", None, write_feather),
    "LAZ (compressed integers)": ("laz", None, write_export("laz")),
}
"""Heading: name of file or folder, format to ask for, writer."""


def measure(path: Path, format: str | None, repeat: int) -> tuple[float, int]:
    """Return the median milliseconds of reading a scan, and the points read in all."""
    sequence = open_sequence(path, format)
    best = np.full(len(sequence), np.inf)
    n_points = sum(len(scan) for scan in sequence)  # warms the file cache and compiles what is compiled
    for _ in range(repeat):
        for i in range(len(sequence)):
            start = time.perf_counter()
            sequence[i]
            best[i] = min(best[i], time.perf_counter() - start)
    return 1e3 * float(np.median(best)), n_points


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=10)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()

    world = simulate("city", "HDL-64E", options.scans)
    run = Unlabelled(ArraySequence([world[i] for i in range(options.scans)], world.stamps))
    n_points = sum(len(run.scan(i)) for i in range(options.scans))
    table = Table(title=f"Reading a scan of {n_points // options.scans:,} points")
    for heading in ("format", "ms", f"under {TARGET_MS:.0f} ms"):
        table.add_column(heading, justify="left" if heading == "format" else "right")
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for heading, (name, format, write) in FORMATS.items():
            try:
                write(run, Path(folder) / name)
                milliseconds, n_read = measure(Path(folder) / name, format, options.repeat)
            except (MissingExtraError, ImportError) as error:
                table.add_row(heading, "-", str(error))
                continue
            assert n_read == n_points, f"{heading}: {n_read} of {n_points} points came back"
            results[heading] = round(milliseconds, 2)
            table.add_row(heading, f"{milliseconds:.2f}", "yes" if milliseconds < TARGET_MS else "no")
    Console().print(table)
    if options.json is not None:
        options.json.write_text(json.dumps({"points": n_points // options.scans, "ms": results}, indent=2) + "\n")


if __name__ == "__main__":
    main()
