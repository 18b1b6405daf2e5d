"""Every table of README and docs from one command, run again only where the method has changed since.

    python benchmarks/all.py --drive DRIVE_0005 [--jobs NAME ...] [--force] [--cache FOLDER]   run what is out of date
    python benchmarks/all.py --list                                               what there is, and what is out of date
    python benchmarks/all.py --write                                   stored results into the tables of README and docs

A job is one script of this folder with fixed arguments. Its result is stored as JSON in benchmarks/results/tables/ with
the commit and a digest of the code that made it; one that is there for today's code is not made again, so the command
goes on where it was interrupted. Tables of the pages stand between `<!-- table NAME -->` and `<!-- end -->`; a test
fails where a page shows anything but the stored result.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

from rich.console import Console
from scores import code_digest, commit
from tables import JOBS, RESULTS, Job, pages, read_result, state_of, with_tables

from automos.atomic import write_text

HERE = Path(__file__).parent


def run(job: Job, drive: Path | None, cache: Path) -> None:
    """Run `job`'s script and store what it found."""
    report = cache / f"{job.name}.json"
    report.parent.mkdir(parents=True, exist_ok=True)
    words = [str(drive) if word == "DRIVE_0005" else word.replace("CACHE", str(cache)) for word in job.arguments]
    subprocess.run([sys.executable, HERE / job.script, *words, "--json", report], check=True)
    stored = {
        "job": job.name,
        "command": f"python benchmarks/{job.script} {' '.join(job.arguments)}",
        "commit": commit(),
        "code": code_digest(),
        "date": datetime.now(UTC).date().isoformat(),
        "result": json.loads(report.read_text()),
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_text(RESULTS / f"{job.name}.json", json.dumps(stored, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drive", type=Path, help="KITTI raw drive 2011_09_26_drive_0005 with truth")
    parser.add_argument("--jobs", nargs="+", choices=list(JOBS), default=list(JOBS))
    parser.add_argument("--force", action="store_true", help="run again what is up to date")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "all")
    arguments = parser.parse_args()
    console, code = Console(), code_digest()
    for name in arguments.jobs:
        job = JOBS[name]
        state = state_of(job, code)
        if arguments.list:
            console.print(f"{name}: {state}; python benchmarks/{job.script} {' '.join(job.arguments)}", markup=False)
        elif not arguments.write and (arguments.force or state != "up to date"):
            if job.needs_drive and arguments.drive is None:
                parser.error(f"{name} is scored on a real drive: give --drive FOLDER, or other --jobs")
            console.print(f"{name}: {state}", markup=False)
            run(job, arguments.drive, arguments.cache / code)  # nothing of another state is taken from there
    if not arguments.list:
        results = {name: found for name in JOBS if (found := read_result(name)) is not None}
        for page in pages():
            write_text(page, with_tables(page.read_text(), results))
        if len(states := {found["commit"] for found in results.values()}) > 1:
            console.print(f"the tables are of {len(states)} states: {', '.join(sorted(states))}; run all of them again")


if __name__ == "__main__":
    main()
