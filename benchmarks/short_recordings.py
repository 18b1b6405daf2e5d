"""How few scans tell raw sweeps from compensated ones? Parts of recordings, as they are and compensated.

    python benchmarks/short_recordings.py [--seed 31] [--scenarios ...] [--json FILE]

Real drives take part where AUTOMOS_RECORDINGS names a folder that holds `sequences/`; they are compensated with the
final poses of the whole drive. Simulated drives are recorded both ways, points in no order and without times. A choice
is right if raw sweeps get any times and compensated ones none.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import numpy.typing as npt
from lines import show_lines
from threadpoolctl import threadpool_limits

from automos import ArraySequence, load_settings, open_sequence
from automos.core.parallel import available_cores
from automos.odometry import estimate_trajectory
from automos.odometry.clock import read_clock
from automos.odometry.timing import choose_timing
from automos.odometry.trajectory import SequenceFrames
from automos.simulation import Convention, record

DRIVES = ("kitti_0005", "kitti_0027")
SCENARIOS = ("city", "avenue", "hills", "motorway", "campus")
SENSORS = ("HDL-64E", "VLP-16")
LENGTHS = (12, 20, 40)
"""Scans of a part; parts overlap by half."""

Kinds = dict[str, list[npt.NDArray]]


def real_drives(folder: Path) -> Iterator[tuple[str, Kinds, npt.NDArray]]:
    """Yield the name of each drive, its scans of both kinds, and their stamps."""
    for name in DRIVES:
        sequence = open_sequence(folder / "sequences" / name)
        frames = SequenceFrames(sequence, estimate_trajectory(sequence, load_settings().odometry))
        kinds = {kind: [of[i].points for i in range(len(sequence))] for kind, of in (("raw", sequence), ("c", frames))}
        yield name, {"raw": kinds["raw"], "compensated": kinds["c"]}, sequence.stamps


def simulated_drives(seed: int, scenarios: list[str]) -> Iterator[tuple[str, Kinds, npt.NDArray]]:
    """Yield the sensor of each drive, its scans of both kinds, and their stamps."""
    for sensor in SENSORS:
        for scenario in scenarios:
            kinds = {}
            for kind, reference in (("raw", "raw"), ("compensated", "middle")):
                kept = Convention(order="random", reference=reference)
                made = record(scenario, sensor, max(LENGTHS), seed, convention=kept)
                kinds[kind] = [made[i].points for i in range(len(made))]
            yield f"simulated {sensor}", kinds, made.stamps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    settings, right = load_settings().odometry, {}
    folder = os.environ.get("AUTOMOS_RECORDINGS")
    drives = [*(real_drives(Path(folder)) if folder else ()), *simulated_drives(arguments.seed, arguments.scenarios)]
    with ThreadPoolExecutor(available_cores()) as pool, threadpool_limits(1, "blas"):
        for name, kinds, stamps in drives:
            for kind, scans in kinds.items():
                for n in LENGTHS:
                    cell = right.setdefault((name, kind), {}).setdefault(n, [])
                    for first in range(0, len(scans) - n + 1, n // 2):
                        part = ArraySequence(scans[first : first + n], stamps[first : first + n])
                        choice = choose_timing(part, settings, None, read_clock(part), pool)
                        cell.append((choice.timing.source == "none") == (kind == "compensated"))
    lines = [["recording", "sweeps", *(f"{n} scans" for n in LENGTHS)]]
    for (name, kind), cells in right.items():
        lines.append([name, kind, *(f"{np.sum(cells[n])} of {len(cells[n])}" for n in LENGTHS)])
    show_lines(lines, arguments.json)


if __name__ == "__main__":
    main()
