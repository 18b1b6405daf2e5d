"""Can the odometry's warnings be trusted? Forty simulated drives, good and bad: who was off, and who was warned of.

    python benchmarks/trust.py [--seed 30] [--scans 60] [--preset default] [--store FOLDER] [--json FILE] [--only TEXT]

A third of a drive is off by the difference between its estimated and its true chord, over the true one (5 m at least);
a drive by its worst third. Off by more than 3 % is bad. A warning counts if it speaks of poses or of trust. Wanted: at
least 95 % of the bad ones warned of, at most 2 % of the others. With --store, figures are kept by the contents of the
package, and only what is missing is computed.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table
from scores import code_digest

from automos import load_settings, open_sequence
from automos.core.atomic import write_text
from automos.core.errors import InputError
from automos.core.scan import Sequence
from automos.odometry import estimate_trajectory
from automos.simulation import SCENARIOS, Conditions, Convention, record
from automos.simulation.recorders import write_recorded

OFF = 0.03
"""Share of the way by which the poses of a bad drive are off."""
SHORT = 5.0
"""Metres of a third of a drive over which nothing shorter counts."""
SAYS_SO = re.compile(r"trust|\bposes?\b", re.IGNORECASE)


@dataclass(frozen=True)
class Drive:
    """A simulated drive as a recorder kept it."""

    scenario: str
    sensor: str
    seed: int
    kept: tuple[str, ...] = ()
    weather: str = "clear"

    def __str__(self) -> str:
        words = [self.scenario, self.sensor, str(self.seed), *self.kept]
        return " ".join(words if self.weather == "clear" else [*words, self.weather])


def drives(seed: int) -> list[Drive]:
    """Return the forty: all scenarios with few and with many beams, the treacherous ones twice more, odd recorders."""
    many = ("HDL-64E", "OS1-128")
    return [
        *(Drive(scenario, "VLP-16", seed) for scenario in SCENARIOS),
        *(Drive(scenario, many[k % 2], seed + 1) for k, scenario in enumerate(SCENARIOS)),
        *(Drive(s, "VLP-16", seed + k) for k in (2, 3) for s in ("canyon", "avenue", "motorway", "slowdown")),
        Drive("junction", "OS1-128", seed + 4, ("turns=1.09", "order=time", "stamps=false")),
        Drive("motorway", "HDL-64E", seed + 4, ("turns=1.2", "order=random")),
        Drive("slowdown", "VLP-16", seed + 4, ("turns=0.92", "order=random", "times=constant")),
        Drive("city", "HDL-64E", seed + 4, ("reference=middle", "reference_speed=0.7")),
        Drive("city", "OS1-128", seed + 5, ("every=5",)),
        Drive("avenue", "HDL-64E", seed + 4, ("leave_out=7", "stamps=false")),
        Drive("hills", "VLP-16", seed + 4, ("renumbered=true", "stamps=false")),
        Drive("avenue", "VLP-16", seed + 5, (), "rain"),
    ]


def examine(drive: Drive, n_scans: int, preset: str) -> dict:
    """Return how far the poses of a drive are off, and what was said of them."""
    convention, conditions = Convention.parse(drive.kept), Conditions(weather=drive.weather)
    made = record(drive.scenario, drive.sensor, n_scans, drive.seed, convention=convention, conditions=conditions)
    with tempfile.TemporaryDirectory() as folder:
        # Only of files is the order found out: a caller's own sequence is in its order.
        recording = open_sequence(write_recorded(made, folder)) if convention.renumbered else made
        return judged(recording, preset)


def judged(recording: Sequence, preset: str) -> dict:
    """Return how far the poses of a recording are off, and what was said of them."""
    start = time.process_time()
    try:
        found = estimate_trajectory(recording, load_settings(preset).odometry)
    except InputError as refusal:
        return {"off": float("inf"), "way_m": 0.0, "said": [f"refused, no poses: {refusal}"], "cpu_seconds": 0.0}
    true = recording.reference_poses
    assert true is not None
    return {
        "off": speed_error(found.T_world_sensor, true),
        "way_m": float(np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1).sum()),
        "said": [text for text in found.diagnostics.get("warnings", []) if SAYS_SO.search(text)],
        "cpu_seconds": time.process_time() - start,
    }


def speed_error(estimated: npt.NDArray[np.float64], true: npt.NDArray[np.float64]) -> float:
    """Return by what share of the way the chords of (N, 4, 4) poses are off in the worst third."""
    ends = np.linspace(0, len(true) - 1, 4).round().astype(int)
    there, here = (np.linalg.norm(np.diff(poses[ends, :3, 3], axis=0), axis=1) for poses in (estimated, true))
    return float((np.abs(there - here) / np.maximum(here, SHORT)).max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=30)
    parser.add_argument("--scans", type=int, default=60)
    parser.add_argument("--preset", default="default")
    parser.add_argument("--store", type=Path)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--only", default="", help="drives whose description holds this")
    arguments = parser.parse_args()
    kept = None if arguments.store is None else arguments.store / f"trust-{code_digest()}-{arguments.preset}.json"
    rows = json.loads(kept.read_text()) if kept is not None and kept.exists() else {}
    chosen = [drive for drive in drives(arguments.seed) if arguments.only in str(drive)]
    for drive in chosen:
        name = f"{drive} {arguments.scans}"
        if name not in rows:
            rows[name] = examine(drive, arguments.scans, arguments.preset)
            print(f"{name}: off by {100 * rows[name]['off']:.1f} % {rows[name]['said']}", flush=True)
            if kept is not None:
                arguments.store.mkdir(parents=True, exist_ok=True)
                write_text(kept, json.dumps(rows))
    of_these = {str(drive): rows[f"{drive} {arguments.scans}"] for drive in chosen}
    _report(of_these)
    if arguments.json:
        arguments.json.write_text(json.dumps(of_these, indent=1))


def _report(rows: dict[str, dict]) -> None:
    table = Table("drive", "way, m", "off by, %", "warned", "", title="drives by how far their poses are off")
    for name, row in sorted(rows.items(), key=lambda item: -item[1]["off"]):
        is_bad, is_warned = row["off"] > OFF, bool(row["said"])
        mark = {(True, False): "[red]silent", (False, True): "[red]false alarm"}.get((is_bad, is_warned), "")
        said = "yes" if is_warned else ""
        table.add_row(name, f"{row['way_m']:.0f}", f"{100 * row['off']:.1f}", said, mark)
    Console(width=120).print(table)
    bad = [row for row in rows.values() if row["off"] > OFF]
    good = [row for row in rows.values() if row["off"] <= OFF]
    warned, alarms = (sum(bool(row["said"]) for row in some) for some in (bad, good))
    print(f"off by more than {100 * OFF:.0f} %: {len(bad)} drives, warned of {warned} ({_percent(warned, bad)})")
    print(f"the others: {len(good)} drives, false warnings of {alarms} ({_percent(alarms, good)})")


def _percent(n: int, some: list) -> str:
    return f"{100 * n / len(some):.0f} %" if some else "none"


if __name__ == "__main__":
    main()
