"""Seconds from a fresh installation to the first result: `automos demo`, `automos label`, cold, warm and again.

    python benchmarks/first_minute.py [RECORDING] [--scans 20] [--json FILE]

A virtual environment is made and this checkout installed into it. *Cold* is the first run: nothing is compiled. *Warm*
is the same with the kernels compiled, into a new folder. *Again* is the same command in the same folder, where all is
found. RECORDING is a folder of files, the first scans of which are labelled; without one, a simulated street is.
Seconds are those of the wall, and of the processor over all processes, which a busy machine spoils less.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]


def install(folder: Path) -> Path:
    """Return the folder of programs of a fresh environment that holds this checkout as pip installs it."""
    venv.create(folder, with_pip=True)
    programs = folder / ("Scripts" if sys.platform == "win32" else "bin")
    subprocess.run([programs / "python", "-m", "pip", "install", "--quiet", ROOT], check=True)
    return programs


def forget_kernels(folder: Path) -> None:
    """Remove what numba compiled, so that the next run is the first."""
    for file in folder.rglob("automos/**/__pycache__/*.nb[ic]"):
        file.unlink()


def timed(command: list[str | Path], where: Path) -> dict[str, float]:
    """Run `command` in folder `where`; return its seconds by the wall's clock and the processors'."""
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
    before, start = os.times(), time.perf_counter()
    subprocess.run(command, cwd=where, env=environment, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - start, os.times()  # of children, which Windows does not know
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return {"wall": round(wall, 1), "cpu": round(cpu, 1)}


def first_scans(recording: Path, count: int, into: Path) -> Path:
    """Copy the first `count` files of a folder of scans."""
    folder = recording / "velodyne" if (recording / "velodyne").is_dir() else recording
    into.mkdir()
    for file in sorted(file for file in folder.iterdir() if file.is_file())[:count]:
        shutil.copyfile(file, into / file.name)
    return into


def measure(work: Path, recording: Path | None, count: int) -> dict[str, dict[str, dict[str, float]]]:
    """Return seconds by command and by how much was there before."""
    programs = install(work / "environment")
    automos = programs / "automos"
    demo = [automos, "demo", "--out"]
    cold = {"cold": timed([*demo, "demo_1"], work)}
    found = {"automos demo": {**cold, "warm": timed([*demo, "demo_2"], work)}}
    if recording is None:
        subprocess.run([automos, "simulate", "street", "--scans", str(count)], cwd=work, check=True)
        log = work / "street" / "velodyne"
    else:
        log = first_scans(recording, count, work / "log")
    forget_kernels(work / "environment")
    label = [automos, "label", log, "--out"]
    found[f"automos label, {count} scans"] = {
        "cold": timed([*label, "run_1"], work),
        "warm": timed([*label, "run_2"], work),
        "again": timed([*label, "run_2"], work),
    }
    return found


def table(found: dict[str, dict[str, dict[str, float]]]) -> str:
    """Return the seconds as a table for the docs."""
    lines = ["| | cold | warm | again |", "|---|---:|---:|---:|"]
    for command, runs in found.items():
        cells = (
            f"{runs[kind]['wall']:.0f} s ({runs[kind]['cpu']:.0f} s CPU)" if kind in runs else "-"
            for kind in ("cold", "warm", "again")
        )
        lines.append(f"| `{command}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", nargs="?", type=Path)
    parser.add_argument("--scans", type=int, default=20)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        found = measure(Path(work), given.recording and given.recording.absolute(), given.scans)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(table(found))
    print(f"\n{os.cpu_count()} cores, {platform.processor() or platform.machine()}, load {load:.1f}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
