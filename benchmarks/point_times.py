"""Is the time of every point known, however a recorder keeps them? By convention and sensor, on simulated drives.

    python benchmarks/point_times.py [--seed 112] [--scenarios city] [--scans 40] [--conventions ...]
                                     [--json FILE]

A wrong time displaces a point by the way of the sensor in between; points that are compensated already should get no
times. A drive is right if that is at most 3 cm on the mean over its points (raw sweeps that are taken for compensated
ones: 25 cm at 10 m/s and 10 Hz). The seconds are those of choosing the timing, on two threads.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from conventions import CASES, Case, InMemory, drive_of, sweeps
from lines import show_lines

from automos import load_settings, open_sequence
from automos.core.scan import Sequence
from automos.odometry import estimate, estimate_trajectory
from automos.odometry.compensation import settled_times
from automos.odometry.trajectory import Trajectory
from automos.simulation import SCENARIOS, write_recorded
from automos.simulation.recorders import Recorded

RIGHT = 0.03
"""Metres by which the points of a drive may be displaced, on the mean."""
EVERY = 4
"""Scans from one whose points are examined to the next."""
THREADS = 2


def examine(turns: InMemory, case: Case, seed: int) -> tuple[float, float]:
    """Return metres by which wrong times displace the points of a drive, and seconds in which they were chosen."""
    recorded = Recorded(turns, case.convention, seed)  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        sequence: Sequence = recorded
        if not case.knows_mounts:  # files of this layout cannot say
            sequence = open_sequence(write_recorded(recorded, Path(folder) / "recording"))
        trajectory, seconds = timed_estimate(sequence)
        return displacement(sequence, trajectory, recorded), seconds


def timed_estimate(sequence: Sequence) -> tuple[Trajectory, float]:
    """Return the trajectory, and the seconds of it in which the timing was chosen."""
    choose, spent = estimate.choose_timing, [0.0]

    def timed(*given: Any) -> Any:
        start = time.perf_counter()
        try:
            return choose(*given)
        finally:
            spent[0] += time.perf_counter() - start

    estimate.choose_timing = timed
    try:
        trajectory = estimate_trajectory(sequence, load_settings("default").odometry, workers=THREADS)
    finally:
        estimate.choose_timing = choose
    return trajectory, spent[0]


def displacement(sequence: Sequence, trajectory: Trajectory, recorded: Recorded) -> float:
    """Return metres by which wrong times displace points on the mean, up to what displaces all of a scan alike."""
    order = np.argsort(recorded.true_stamps)
    stamps, poses = recorded.true_stamps[order], recorded.turns.poses_at(recorded.true_stamps[order])
    steps, gaps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1), np.diff(stamps)
    is_next = gaps > 0.0  # what is there twice is no step
    speeds = np.interp(recorded.true_stamps, stamps[1:][is_next], steps[is_next] / gaps[is_next])
    lasts = trajectory.timing.share * float(np.median(gaps[is_next]))  # seconds of a sweep
    about, off = recorded.convention, []
    for i in range(0, len(sequence), EVERY):
        scan = sequence[i]
        rows, kept = np.flatnonzero(scan.is_valid), int(scan.name)
        times = settled_times(scan, trajectory.timing, trajectory.sweep_motion[i], rows)
        found = np.zeros(len(rows)) if times is None else lasts * times.astype(np.float64)
        left = 0.0 if about.reference != "raw" else 1.0
        left += 1.0 - about.reference_speed  # of the motion, in the points
        wrong = found - left * recorded.when(kept)[rows]
        off.append(speeds[kept] * np.abs(wrong - np.median(wrong)).mean())
    return float(np.mean(off))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [name for name in CASES if not CASES[name].is_cut_free]
    parser.add_argument("--conventions", nargs="+", choices=names, default=names)
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=["city"])
    parser.add_argument("--sensors", nargs="+", default=["HDL-64E", "OS1-128", "VLP-16"])
    parser.add_argument("--seed", type=int, default=112)
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows: dict[tuple[str, str], list[tuple[float, float]]] = {}
    # Conventions of the same sweeps follow each other: a drive is cast once for all of them.
    in_order = sorted(arguments.conventions, key=lambda name: str(drive_of(CASES[name])))
    for scenario, sensor, name in product(arguments.scenarios, arguments.sensors, in_order):
        turns = sweeps(scenario, sensor, arguments.scans, arguments.seed, drive_of(CASES[name]))
        found = examine(turns, CASES[name], arguments.seed)
        print(f"{scenario} {sensor}, {name}: points displaced by {100 * found[0]:.1f} cm, {found[1]:.1f} s", flush=True)
        rows.setdefault((name, sensor), []).append(found)
    lines = [["points displaced by wrong times, cm", *arguments.sensors, "right", "chosen in, s"]]
    for name in arguments.conventions:
        of_sensors = [np.array(rows[name, sensor]) for sensor in arguments.sensors]
        all_off, seconds = np.concatenate(of_sensors).T
        cells = [f"{100 * off[:, 0].max():.1f}" for off in of_sensors]
        right = f"{np.sum(all_off <= RIGHT)} of {len(all_off)}"
        lines.append([name, *cells, right, f"{np.median(seconds):.1f}, {seconds.max():.1f} at most"])
    show_lines(lines, arguments.json)


if __name__ == "__main__":
    main()
