"""Drift of the odometry, before and after refinement, on real drives and simulated worlds, from raw scans.

    AUTOMOS_RECORDINGS=folder python benchmarks/odometry.py [--worlds canyon motorway]
        [--sensors HDL-64E OS1-128 VLP-16] [--scans 100] [--seed 0] [--cache FOLDER] [--json FILE] [--set KEY=VALUE ...]

Errors are in percent of the distance driven meanwhile, over stretches that start at every scan: mean / max. A stretch
on which the vehicle came less than a metre has none. Wall thickness is what surfaces seen a second apart measure
across: it needs no reference, so it also tells how good the reference's own poses are. --set changes fields of the
odometry's settings. Real drives are the folders sequences/NAME of AUTOMOS_RECORDINGS that hold poses. Simulated
recordings are kept in the cache folder.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml
from rich.console import Console
from rich.table import Table

from automos import open_sequence
from automos.core.progress import StageProgress
from automos.core.scan import Sequence
from automos.evaluation.trajectory import RelativeErrors, errors_over_distance, errors_over_time
from automos.odometry import estimate_trajectory
from automos.odometry.trajectory import Trajectory
from automos.settings import OdometrySettings
from automos.simulation import simulate, write
from automos.simulation.sequence import FORMAT

STANDING = 1.0
"""Metres of a stretch below which it has no error in percent."""
STRETCHES = ("10 m", "1 s", "5 s")


def measure(sequence: Sequence, settings: OdometrySettings) -> dict:
    """Return errors, wall thickness and seconds per scan of the odometry with and without refinement."""
    reference = sequence.reference_poses
    row: dict = {"scans": len(sequence), "walls_reference_m": _walls(sequence, settings, reference)}
    for name, refine in (("before", False), ("after", True)):
        wall, cpu = time.perf_counter(), time.process_time()
        found = estimate_trajectory(sequence, settings.model_copy(update={"refine": refine}))
        seconds = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
        row[name] = {
            **_errors(found, reference),
            "walls_m": _walls(sequence, settings, found.T_world_sensor),
            **{f"{clock}_seconds_per_scan": value / len(sequence) for clock, value in seconds.items()},
        }
    return row


def _errors(found: Trajectory, reference: np.ndarray) -> dict:
    poses, stamps = found.T_world_sensor, found.stamps
    return {
        "10 m": _figures(errors_over_distance(poses, reference, 10.0)),
        "1 s": _figures(errors_over_time(poses, reference, stamps, 1.0)),
        "5 s": _figures(errors_over_time(poses, reference, stamps, 5.0)),
    }


def _figures(errors: RelativeErrors) -> dict | None:
    is_driven = errors.length >= STANDING
    if not is_driven.any():
        return None
    percent = errors.translation_percent[is_driven]
    return {"mean": float(percent.mean()), "median": float(np.median(percent)), "max": float(percent.max())}


def _walls(sequence: Sequence, settings: OdometrySettings, poses: np.ndarray) -> float | None:
    return estimate_trajectory(sequence, settings, poses=poses).diagnostics["wall_thickness_m"]


def recordings(arguments: argparse.Namespace) -> Iterator[Path]:
    """Yield the folders of the real drives, then of the simulated worlds."""
    root = os.environ.get("AUTOMOS_RECORDINGS")
    drives = sorted(Path(root, "sequences").glob("*/poses.txt")) if root else []
    if not drives and not arguments.no_drives:
        Console(stderr=True).print("No real drives: set AUTOMOS_RECORDINGS to a folder that holds sequences/NAME.")
    for poses in [] if arguments.no_drives else drives:
        yield poses.parent
    for world in arguments.worlds:
        for sensor in arguments.sensors:
            folder = arguments.cache / f"{world}-{sensor}-{arguments.scans}-{arguments.seed}-v{FORMAT}"
            with StageProgress(Console(stderr=True), folder.name) as progress:
                write(simulate(world, sensor, arguments.scans, arguments.seed), folder, 0, progress)
            yield folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", nargs="*", default=["canyon", "motorway"])
    parser.add_argument("--sensors", nargs="+", default=["HDL-64E", "OS1-128", "VLP-16"])
    parser.add_argument("--scans", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-drives", action="store_true", help="simulated worlds only")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "suite")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="fields of the odometry's settings")
    arguments = parser.parse_args()
    arguments.cache.mkdir(parents=True, exist_ok=True)
    changes = {key: yaml.safe_load(value) for key, value in (pair.split("=", 1) for pair in arguments.set)}
    settings = OdometrySettings(**changes)
    rows = {}
    table = Table("recording", "refined", *(f"{s}, %" for s in STRETCHES), "walls, cm", "s/scan (CPU)")
    for folder in recordings(arguments):
        rows[folder.name] = row = measure(open_sequence(folder), settings)
        for name in ("before", "after"):
            table.add_row(folder.name if name == "before" else "", name, *_cells(row[name]))
        table.add_row("", "reference", *[""] * len(STRETCHES), _centimetres(row["walls_reference_m"]), "")
        Console(stderr=True).print(folder.name, *_cells(row["after"]), sep="   ")
    Console(width=110).print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


def _cells(row: dict) -> list[str]:
    errors = ["-" if row[s] is None else f"{row[s]['mean']:.2f} / {row[s]['max']:.2f}" for s in STRETCHES]
    seconds = f"{row['wall_seconds_per_scan']:.3f} ({row['cpu_seconds_per_scan']:.3f})"
    return [*errors, _centimetres(row["walls_m"]), seconds]


def _centimetres(metres: float | None) -> str:
    return "-" if metres is None else f"{100 * metres:.1f}"


if __name__ == "__main__":
    main()
