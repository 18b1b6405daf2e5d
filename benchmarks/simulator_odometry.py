"""Can odometry follow the simulated worlds? KISS-ICP, as the preset `paper` uses it, and `default`, against the truth.

    python benchmarks/simulator_odometry.py [--scenarios ...] [--sensor HDL-64E] [--scans 80] [--seed 0]
        [--presets paper default] [--json FILE]

Odometry knows nothing of the truth; with `paper` nothing is refined. Drift is how far the last scan is put from where
it is, as seen from the first; where it is more than 3 % of the way (and 0.1 m), the line is marked.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from automos import load_settings
from automos.core.array_sequence import ArraySequence
from automos.core.geometry import inverse
from automos.evaluation.trajectory import errors_over_time, path_length, rotation_angle
from automos.odometry import estimate_trajectory
from automos.settings import PRESETS
from automos.simulation import SCENARIOS, SENSORS, simulate
from automos.simulation.sequence import SimulatedSequence

TOLERANCE, SLACK = 0.03, 0.1
"""Share of the way, and metres beside it, that odometry may be off."""


def follow(world: SimulatedSequence, preset: str) -> dict[str, float]:
    """Return the way driven, the drift at its end and the median error over one second, metres and degrees."""
    recording = ArraySequence(list(world), world.stamps, name=world.name, is_compensated=world.is_compensated)
    found = estimate_trajectory(recording, load_settings(preset).odometry).T_world_sensor
    true = world.reference_poses
    error = inverse(inverse(true[0]) @ true[-1]) @ inverse(found[0]) @ found[-1]
    over_second = errors_over_time(found, true, world.stamps, 1.0)
    return {
        "way_m": float(path_length(true)[-1]),
        "drift_m": float(np.linalg.norm(error[:3, 3])),
        "turn_deg": float(np.degrees(rotation_angle(error[:3, :3]))),
        "over_1s_m": float(np.median(over_second.translation)) if len(over_second) else float("nan"),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=list(SCENARIOS))
    parser.add_argument("--sensor", choices=SENSORS, default="HDL-64E")
    parser.add_argument("--scans", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--presets", nargs="+", choices=PRESETS, default=["paper", "default"])
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows: dict[str, dict[str, dict[str, float]]] = {}
    heading = ("drift, m", "drift, %", "turn, deg", "over 1 s, m")
    print(f"{'scenario':12s}{'preset':10s}{'way, m':>9s}", *(f"{name:>11s}" for name in heading))
    for scenario in arguments.scenarios:
        world = simulate(scenario, arguments.sensor, arguments.scans, arguments.seed)
        rows[scenario] = {}
        for preset in arguments.presets:
            row = rows[scenario][preset] = follow(world, preset)
            way, drift = row["way_m"], row["drift_m"]
            percent = f"{100 * drift / way:.1f}" if way > 1.0 else "-"
            mark = "" if drift <= TOLERANCE * way + SLACK else "  <-- lost"
            found = (f"{drift:.2f}", percent, f"{row['turn_deg']:.2f}", f"{row['over_1s_m']:.3f}")
            print(f"{scenario:12s}{preset:10s}{way:9.0f}", *(f"{text:>11s}" for text in found), mark, flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
