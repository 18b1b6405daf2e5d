"""Every table of README and docs from one command, run again only where the method has changed since.

    python benchmarks/all.py --drive DRIVE_0005 [--store STORE] [--only NAME ...] [--force] [--cache FOLDER]
                                                                                         run what is out of date
    python benchmarks/all.py --drive DRIVE_0005 --quick                                     the short form of each
    python benchmarks/all.py --list                                               what there is, and what is out of date
    python benchmarks/all.py --write                                   stored results into the tables of README and docs

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
from datetime import UTC, datetime
from pathlib import Path

from jobs import JOBS, Job
from rich.console import Console
from scores import code_digest, commit
from tables import RESULTS, pages, read_result, state_of, with_tables

from automos.atomic import write_text

HERE = Path(__file__).parent


def run(job: Job, drive: Path | None, store: Path, cache: Path, is_quick: bool) -> None:
    """Run `job`'s script on the drive and the gate's worlds in `store`, and keep what it found."""
    report = cache / f"{job.name}.json"
    report.parent.mkdir(parents=True, exist_ok=True)
    arguments = job.quick if is_quick else job.arguments
    places = {"DRIVE_0005": str(drive), "STORE": str(store)}
    words = [places.get(word, word.replace("CACHE", str(cache))) for word in arguments]
    subprocess.run([sys.executable, HERE / job.script, *words, "--json", report], check=True)
    stored = {
        "job": job.name,
        "is_quick": is_quick,
        "commit": commit(),
        "code": code_digest(job.rooms),
        "date": datetime.now(UTC).date().isoformat(),
        "result": json.loads(report.read_text()),
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_text(RESULTS / f"{job.name}.json", json.dumps(stored, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drive", type=Path, help="KITTI raw drive 2011_09_26_drive_0005 with truth")
    parser.add_argument(
        "--store", type=Path, default=Path.home() / ".cache" / "automos" / "gate", help="gate.py's worlds"
    )
    parser.add_argument("--only", nargs="+", choices=list(JOBS), default=list(JOBS), metavar="NAME")
    parser.add_argument("--quick", action="store_true", help="the short form of each job")
    parser.add_argument("--force", action="store_true", help="run again what is up to date")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "all")
    arguments = parser.parse_args()
    console, failed = Console(), []
    for name in arguments.only:
        job = JOBS[name]
        code = code_digest(job.rooms)
        state = state_of(job, code)
        is_made = state == "up to date" or (arguments.quick and state.startswith("up to date"))
        console.print(f"{name}: {state}; {job.command(arguments.quick)}", markup=False, soft_wrap=True)
        if arguments.list or arguments.write or (is_made and not arguments.force):
            continue
        if job.needs_drive and arguments.drive is None:
            parser.error(f"{name} is scored on a real drive: give --drive FOLDER, or others with --only")
        if job.needs_recordings and not os.environ.get("AUTOMOS_RECORDINGS"):
            parser.error(f"{name} is about real recordings: let AUTOMOS_RECORDINGS name their folder, or see --only")
        try:
            # nothing of another state is taken
            run(job, arguments.drive, arguments.store, arguments.cache / code, arguments.quick)
        except subprocess.CalledProcessError as error:
            failed.append(name)
            console.print(f"{name} failed with exit code {error.returncode}; the others go on", markup=False)
    if not arguments.list:
        results = {name: found for name in JOBS if (found := read_result(name)) is not None}
        for page in pages():
            write_text(page, with_tables(page.read_text(), results))
        if len(states := {found["commit"] for found in results.values()}) > 1:
            console.print(f"the tables are of {len(states)} states: {', '.join(sorted(states))}; run all of them again")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
