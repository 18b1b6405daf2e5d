"""What a simulated sweep costs on one core, with how many road users on the move in sight of the sensor.

    python benchmarks/simulator_speed.py [--scenarios ...] [--sensor HDL-64E] [--sweeps 20]
        [--scans 100] [--seed 0] [--json FILE]

Counts the processor's time of this process, so that neighbours on the machine do not spoil it, over everything a caller
asks for: the scan and its truth. Time of all threads counts, so BLAS's, which spin while they wait, are held to one.
Movers are the road users within reach, whether they move or wait; seen are those that move at some time and have
points in the sweep.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from automos.core.labels import Label
from automos.simulation import SCENARIOS, SENSORS, SimulatedSequence, simulate

REACH = 120.0
"""Metres around the sensor within which road users are counted."""


def n_movers(world: SimulatedSequence, index: int) -> int:
    """Return how many road users are on the site and within reach at a scan."""
    states, present = world.world.object_states(world.stamps[index])
    ego = world.world.ego.at(world.stamps[index])[:2, 3]
    parked = np.arange(len(present)) < len(world.world.parked)
    return int(np.count_nonzero(present & ~parked & (np.linalg.norm(states[:, :2] - ego, axis=1) < REACH)))


def time_sweeps(world: SimulatedSequence, sweeps: np.ndarray) -> dict[str, float]:
    """Return the cost of `sweeps` of one recording, after the first has compiled and built what is built once."""
    start = time.process_time()
    world.truth(0)
    first = time.process_time() - start
    seconds, movers, seen = [], [], []
    for k in sweeps:
        start = time.process_time()
        scan, truth = world[int(k)], world.truth(int(k))
        seconds.append(time.process_time() - start)
        assert len(scan) == len(truth)
        movers.append(n_movers(world, int(k)))
        seen.append(len(np.unique(truth[(truth & 0xFFFF) == Label.MOVING] >> 16)))
    return {
        "movers": float(np.mean(movers)),
        "movers_seen": float(np.mean(seen)),
        "first_s": first,
        "mean_ms": 1e3 * float(np.mean(seconds)),
        "max_ms": 1e3 * float(np.max(seconds)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=list(SCENARIOS))
    parser.add_argument("--sensor", choices=SENSORS, default="HDL-64E")
    parser.add_argument("--sweeps", type=int, default=20)
    parser.add_argument("--scans", type=int, default=100, help="length of the recording the sweeps are taken from")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    sweeps = np.linspace(1, arguments.scans - 1, arguments.sweeps).astype(int)
    rows = {}
    print(f"{'scenario':12s}{'movers':>8s}{'seen':>6s}{'mean, ms':>10s}{'max, ms':>9s}{'first, s':>10s}")
    for scenario in arguments.scenarios:
        world = simulate(scenario, arguments.sensor, arguments.scans, arguments.seed)
        with threadpool_limits(1, "blas"):
            row = rows[scenario] = time_sweeps(world, sweeps)
        counts = f"{row['movers']:8.0f}{row['movers_seen']:6.0f}"
        print(f"{scenario:12s}{counts}{row['mean_ms']:10.0f}{row['max_ms']:9.0f}{row['first_s']:10.1f}", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
