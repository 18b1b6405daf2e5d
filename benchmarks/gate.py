"""The frozen measure: what a change of the method costs on worlds and recordings that nothing was chosen on.

    python benchmarks/gate.py --store FOLDER [--parts worlds tutorial real conventions] [--seeds 100 101 102 103]
                              [--scenarios ...] [--sensors ...] [--scans 60] [--preset default] [--workers 1]
                              [--against TABLE] [--save] [--name NAME] [--diagram FILE] [--json FILE]
                              [--simulate-only | --scored-only]

Worlds are simulated once into FOLDER (about 12 GB for all 144) and scored without being looked at: for understanding,
simulate other seeds. `tutorial` is the recording of docs/tutorial.md, where a car drives and stops. Real recordings
take part where AUTOMOS_RECORDINGS names a folder that holds `sequences/`; of drive 0005, the conventions of recorders,
too. Scores are kept by the contents of the installed `automos` package, so a second run, or one after an interruption,
labels only what is missing; --scored-only labels nothing and shows what is there.

The result is compared, cell by cell, with a stored table: --against a file of benchmarks/results/ or its stem, else the
newest there. --save stores this one, as NAME (default: the commit of the package). --diagram draws how often labels of
each confidence are right.
Seconds are processor seconds, so that other work on the machine disturbs them little; memory is the peak of the
process. Both depend on the machine: compare tables of one machine.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from conventions import CASES, OF_DRIVE
from gate_table import calibration, draw_reliability, print_tables
from rich.console import Console
from scores import Scores, commit
from store import stored_world

from automos import open_sequence
from automos.core.progress import StageProgress
from automos.simulation import FORMAT, SCENARIOS
from automos.simulation.recorders import Recorded, TurnsByAzimuth, write_recorded

NICE = 10
"""Priority that the gate takes at most, lower being higher."""
SEEDS = (100, 101, 102, 103)
PARTS = ("worlds", "tutorial", "real", "conventions")
SENSORS = ("HDL-64E", "OS1-128", "VLP-16")
TUTORIAL = ("city", "HDL-64E", 60, 0)
"""Scenario, sensor, scans and seed of the tutorial's recording."""
REAL = ("kitti_0005", "kitti_0027", "room_vlp16", "yard_avia", "handheld_xt32")
RESULTS = Path(__file__).parent / "results"


def worlds(arguments: argparse.Namespace, scores: Scores) -> dict[str, dict]:
    """Return the rows of all chosen worlds, by `seed/scenario/sensor`."""
    rows = {}
    for seed in arguments.seeds:
        for scenario in arguments.scenarios:
            for sensor in arguments.sensors:
                asked = (arguments.store, scenario, sensor, arguments.scans, seed)
                if arguments.simulate_only:
                    with StageProgress(Console(stderr=True), f"{scenario} {sensor} {seed}") as progress:
                        stored_world(*asked, progress)
                    continue
                name = f"{scenario}-{sensor}-{arguments.scans}-{seed}"
                rows[f"{seed}/{scenario}/{sensor}"] = scores.of(name, lambda p, asked=asked: stored_world(*asked, p))
    return rows


def real(root: Path, scores: Scores) -> dict[str, dict]:
    """Return the rows of the real recordings that are there."""
    there = [name for name in REAL if (root / name).is_dir()]
    return {f"real/{name}": scores.of(f"real-{name}", lambda _, n=name: open_sequence(root / n)) for name in there}


def conventions(root: Path, scores: Scores) -> dict[str, dict]:
    """Return the rows of drive 0005 as other recorders would have kept it: written so, and read as anyone's is."""
    if not (root / "kitti_0005").is_dir():
        return {}
    turns = TurnsByAzimuth(open_sequence(root / "kitti_0005"))
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in OF_DRIVE:
            recording = Path(folder) / "recording"
            kept = Recorded(turns, CASES[name].convention)
            rows[f"convention/{name}"] = scores.of(
                f"0005-{name}, read back", lambda _, kept=kept, at=recording: open_sequence(write_recorded(kept, at))
            )
            shutil.rmtree(recording, ignore_errors=True)
    return rows


def table_file(name: str | None, other_than: str) -> Path | None:
    """Return the stored table of that name, or the newest but `other_than`."""
    if name is not None:
        path = Path(name) if Path(name).exists() else RESULTS / f"gate-{name.removeprefix('gate-')}.json"
        if not path.exists():
            raise SystemExit(f"there is no table {path}; stored ones: {', '.join(p.stem for p in RESULTS.glob('*'))}")
        return path
    stored = [path for path in RESULTS.glob("gate-*.json") if path.stem != f"gate-{other_than}"]
    return max(stored, key=lambda path: json.loads(path.read_text())["date"], default=None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=list(SCENARIOS))
    parser.add_argument("--sensors", nargs="+", default=list(SENSORS))
    parser.add_argument("--scans", type=int, default=60)
    parser.add_argument("--preset", default="default")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--against")
    parser.add_argument("--save", action="store_true")
    parser.add_argument("--name", default=commit())
    parser.add_argument("--diagram", type=Path)
    parser.add_argument("--json", type=Path, help="the table, for the docs")
    parser.add_argument("--simulate-only", action="store_true")
    parser.add_argument("--scored-only", action="store_true")
    arguments = parser.parse_args()
    os.nice(max(0, NICE - os.nice(0)))
    scores, rows = Scores(arguments.store, arguments.preset, arguments.workers, arguments.scored_only), {}
    if "worlds" in arguments.parts:
        rows |= worlds(arguments, scores)
    if "tutorial" in arguments.parts and not arguments.simulate_only:
        name = "-".join(map(str, TUTORIAL))
        rows["tutorial"] = scores.of(name, lambda progress: stored_world(arguments.store, *TUTORIAL, progress))
    root = Path(os.environ.get("AUTOMOS_RECORDINGS", "")) / "sequences"
    if os.environ.get("AUTOMOS_RECORDINGS") and not arguments.simulate_only:
        rows |= real(root, scores) if "real" in arguments.parts else {}
        rows |= conventions(root, scores) if "conventions" in arguments.parts else {}
    rows = {key: row for key, row in rows.items() if row}
    if not rows:
        return
    table = {
        "name": arguments.name,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "preset": arguments.preset,
        "scans": arguments.scans,
        "simulator_format": FORMAT,
        "calibration": calibration({key: row for key, row in rows.items() if "refused" not in row}),
        "rows": rows,
    }
    before_file = table_file(arguments.against, arguments.name)
    before = None if before_file is None else json.loads(before_file.read_text())
    print_tables(table, before)
    if arguments.diagram is not None:
        draw_reliability(table, arguments.diagram)
    if arguments.json is not None:
        arguments.json.write_text(_as_text(table))
    if arguments.save:
        RESULTS.mkdir(exist_ok=True)
        out = RESULTS / f"gate-{arguments.name}.json"
        out.write_text(_as_text(table))
        print(f"stored as {out}")


def _as_text(table: dict) -> str:
    """Return `table` as JSON of one row a line, so that tables can be read and compared as text."""
    rows = {
        key: {
            name: None if value != value else round(value, 6) if isinstance(value, float) else value
            for name, value in row.items()
            if name != "reliability"
        }
        for key, row in table["rows"].items()
    }
    lines = ",\n".join(f"  {json.dumps(key)}: {json.dumps(row)}" for key, row in rows.items())
    head = json.dumps({**table, "rows": 0}, indent=1)
    return head.replace('"rows": 0', f'"rows": {{\n{lines}\n }}') + "\n"


if __name__ == "__main__":
    main()
