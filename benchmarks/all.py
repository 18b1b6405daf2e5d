"""Every table of README and docs from one command, run again only where the method has changed since.

    python benchmarks/all.py --drive DRIVE_0005 [--store STORE] [--only NAME ...] [--force] [--cache FOLDER]
                             [--at-once 1]                                               run what is out of date
    python benchmarks/all.py --drive DRIVE_0005 --quick                                     the short form of each
    python benchmarks/all.py --list                                               what there is, and what is out of date
    python benchmarks/all.py --write                                   stored results into the tables of README and docs

Jobs that measure seconds or memory run first, each alone; of the others, --at-once run side by side.
Jobs about the recordings of `docs/quality.md` need the environment variable AUTOMOS_RECORDINGS, as `gate.py` does.
A job is one script of this folder with fixed arguments. Its result is stored as JSON in benchmarks/results/tables/ with
the commit and a digest of the code that made it; one that is there for today's code is not made again, so the command
goes on where it was interrupted. Tables of the pages stand between `<!-- table NAME -->` and `<!-- end -->`, each with
the command, the commit and the day; a test fails where a page shows anything but the stored result.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

from job import Job
from jobs import JOBS
from rich.console import Console
from scores import code_digest, commit
from tables import RESULTS, ROOT, pages, read_result, state_of, with_tables

from automos.core.atomic import write_text

HERE = Path(__file__).parent


def run(job: Job, arguments: argparse.Namespace) -> None:
    """Run `job`'s script, and store what it found with the state of the code."""
    code = code_digest(job.rooms, job.also)
    cache = arguments.cache / code  # nothing of another state is taken
    report = cache / f"{job.name}.json"
    report.parent.mkdir(parents=True, exist_ok=True)
    places = {"DRIVE_0005": arguments.drive, "STORE": arguments.store, "CACHE": cache, "DOCS": ROOT / "docs"}
    words = job.quick if arguments.quick else job.arguments
    for name, place in places.items():
        words = tuple(word.replace(name, str(place)) for word in words)
    subprocess.run([sys.executable, HERE / job.script, *words, "--json", report], check=True)
    stored = {
        "job": job.name,
        "is_quick": arguments.quick,
        "commit": commit(),
        "code": code,
        "date": datetime.now(UTC).date().isoformat(),
        "result": json.loads(report.read_text()),
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_text(RESULTS / f"{job.name}.json", json.dumps(stored, indent=1) + "\n")


def run_each(jobs: list[Job], arguments: argparse.Namespace) -> list[str]:
    """Run `jobs`, those that are timed first and alone; return the names of those that failed."""
    failed = []

    def tried(job: Job) -> None:
        try:
            run(job, arguments)
        except subprocess.CalledProcessError as error:
            failed.append(job.name)
            Console().print(f"{job.name} failed with exit code {error.returncode}; the others go on", markup=False)

    for job in jobs:
        if job.is_timed:
            tried(job)
    with ThreadPoolExecutor(arguments.at_once) as pool:
        list(pool.map(tried, [job for job in jobs if not job.is_timed]))
    return failed


def due(arguments: argparse.Namespace) -> list[Job]:
    """Return the jobs of `arguments.only` that are out of date, all with --force; print what there is."""
    jobs = []
    for name in arguments.only:
        job = JOBS[name]
        state = state_of(job, code_digest(job.rooms, job.also))
        is_made = state == "up to date" or (arguments.quick and state.startswith("up to date"))
        Console().print(f"{name}: {state}; {job.command(arguments.quick)}", markup=False, soft_wrap=True)
        if arguments.force or not is_made:
            jobs.append(job)
    return jobs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drive", type=Path, help="KITTI raw drive 2011_09_26_drive_0005 with truth")
    parser.add_argument(
        "--store", type=Path, default=Path.home() / ".cache" / "automos" / "gate", help="gate.py's worlds"
    )
    parser.add_argument("--only", nargs="+", choices=list(JOBS), default=list(JOBS), metavar="NAME")
    parser.add_argument("--quick", action="store_true", help="the short form of each job")
    parser.add_argument("--force", action="store_true", help="run again what is up to date")
    parser.add_argument("--at-once", type=int, default=1, help="jobs that run side by side, none of them timed")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "all")
    arguments = parser.parse_args()
    jobs = due(arguments)
    if arguments.list:
        return
    failed = []
    if not arguments.write:
        for job in jobs:
            if job.needs_drive and arguments.drive is None:
                parser.error(f"{job.name} is scored on a real drive: give --drive FOLDER, or others with --only")
            if job.needs_recordings and not os.environ.get("AUTOMOS_RECORDINGS"):
                parser.error(f"{job.name} is about real recordings: AUTOMOS_RECORDINGS names no folder; see --only")
        failed = run_each(jobs, arguments)
    results = {name: found for name in JOBS if (found := read_result(name)) is not None}
    for page in pages():
        write_text(page, with_tables(page.read_text(), results))
    if len(states := {found["commit"] for found in results.values()}) > 1:
        Console().print(f"the tables are of {len(states)} states: {', '.join(sorted(states))}; run all of them again")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
