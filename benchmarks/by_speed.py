"""What a method finds of movers by their speed: recall in simulated worlds, and what its tests cost it.

    python benchmarks/by_speed.py [--method m_detector] [--scenarios campus junction slowdown motorway]
                                  [--sensor HDL-64E] [--scans 40] [--seed 5] [--json FILE]

Poses are the true ones, so that what is missed is the method's; speeds are over the ground. M-detector is run twice: as
published, and without "map consistency", by which an image in which something stood where a point lies says nothing.
The first 15 scans, its warm-up, do not count.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table

from automos import load_settings
from automos.baselines import m_detector, methods
from automos.baselines.m_detector_parameters import KITTI
from automos.core.labels import Label, to_mos
from automos.odometry import estimate_trajectory
from automos.odometry.trajectory import SequenceFrames
from automos.simulation import simulate
from automos.simulation.sequence import SimulatedSequence

WARM_UP = 15
EDGES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, np.inf)
"""m/s."""

_NOWHERE = 1e-6  # metres, rad: nothing lies so near
INCONSISTENT = replace(
    KITTI,
    crossing=KITTI.crossing._replace(tolerance=_NOWHERE),
    away=KITTI.away._replace(tolerance=_NOWHERE),
    nearer=KITTI.nearer._replace(tolerance=_NOWHERE),
)
"""M-detector without map consistency."""


def speeds(world: SimulatedSequence, index: int) -> dict[int, float]:
    """Return the speed over the ground, m/s, of every object of which scan `index` and its neighbours hold points."""
    before, after = world.boxes(index - 1), world.boxes(index + 1)
    was = dict(zip(before.ids.tolist(), before.boxes.center, strict=True))
    seconds = float(world.stamps[index + 1] - world.stamps[index - 1])
    return {
        i: float(np.linalg.norm(center - was[i])) / seconds
        for i, center in zip(after.ids.tolist(), after.boxes.center, strict=True)
        if i in was
    }


def count(world: SimulatedSequence, found: Iterable[tuple[int, npt.NDArray[np.bool_]]]) -> tuple[npt.NDArray, int, int]:
    """Return points and points found of movers by speed (B, 2), false points, and scans counted."""
    table, false, n = np.zeros((len(EDGES) - 1, 2), np.int64), 0, 0
    for i, is_moving in found:
        if not WARM_UP <= i < len(world) - 1:
            continue
        scan, truth = world[i], world.truth(i)
        called = np.zeros(len(scan), bool)
        called[scan.is_valid] = is_moving
        label, instance, n = to_mos(truth), truth >> 16, n + 1
        false += int(np.count_nonzero(called & (label == Label.STATIC)))
        for k, speed in speeds(world, i).items():
            rows = (instance == k) & (label == Label.MOVING)
            table[np.searchsorted(EDGES, speed, side="right") - 1] += rows.sum(), (rows & called).sum()
    return table, false, n


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", default="m_detector", choices=list(methods.BASELINES))
    parser.add_argument("--scenarios", nargs="+", default=["campus", "junction", "slowdown", "motorway"])
    parser.add_argument("--sensor", default="HDL-64E")
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    settings = load_settings("default")
    rows = []
    for scenario in arguments.scenarios:
        world = simulate(scenario, arguments.sensor, arguments.scans, arguments.seed)
        trajectory = estimate_trajectory(world, settings.odometry, world.reference_poses)
        frames, stamps, ground = SequenceFrames(world, trajectory), trajectory.stamps, settings.candidates.ground
        runs = {"as published": methods.BASELINES[arguments.method].find_moving(frames, stamps, settings, 0)}
        if arguments.method == "m_detector":
            runs["without map consistency"] = m_detector.find_moving(frames, INCONSISTENT, stamps, ground)
        for name, found in runs.items():
            table, false, n = count(world, found)
            rows.append({"world": scenario, "run": name, "points": table.tolist(), "false_per_scan": false / max(n, 1)})
            Console().print(scenario, name, table.tolist(), f"{false / max(n, 1):.0f} false a scan", markup=False)
    if arguments.json:
        arguments.json.write_text(json.dumps({"edges": EDGES[:-1], "rows": rows}, indent=1))
    Console(width=200).print(_table(rows))


def _table(rows: list[dict]) -> Table:
    names = [f"{a:g}-{b:g}" if np.isfinite(b) else f"{a:g}-" for a, b in pairwise(EDGES)]
    table = Table("world", "run", *names, "false a scan", title="recall % by speed, m/s")
    for row in rows:
        cells = [f"{100 * found / n:.0f}" if n else "" for n, found in row["points"]]
        table.add_row(row["world"], row["run"], *cells, f"{row['false_per_scan']:.0f}")
    return table


if __name__ == "__main__":
    main()
