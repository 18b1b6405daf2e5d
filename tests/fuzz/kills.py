"""Kill, starve, lock out and race commands, and count what is lost: python tests/fuzz/kills.py --faults 100 [--seed 0].

A fault is a command (label, also over results of other settings, export, merge, clean, report, map, or `Result.save`)
into a folder that others' files lie beside, behind or, of `label over`, within, and one of: a kill at a random moment,
a disk that is full from a random number of bytes on, a folder that may not be written, a link, a second run at the same
time. After it no file of anybody is changed, what is unfinished passes for results nowhere, and the command, run again,
gives the bytes that it gives undisturbed.
"""

import argparse
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from worlds import lane, write_bins

import automos
from automos.cli import main as command_line
from automos.core.errors import InputError

PATIENCE = 120
"""Seconds of processor time that one command may take."""
NOBODY = 65534
N_SCANS = 8
COMMANDS = {
    "label": ("label", "{log}", "--workers", "1", "--out", "{out}"),
    "label over": ("label", "{log}", "--workers", "1", "--out", "{out}"),
    "former": ("label", "{log}", "--workers", "1", "--out", "{out}", "--set", "tracking.max_gap=0"),
    "export": ("export", "{run}", "{log}", "--to", "kitti_tracking", "--out", "{out}"),
    "merge": ("merge", "{run}", "{log}", "{run}/predictions", "--out", "{out}"),
    "clean": ("clean", "{run}", "--out", "{out}"),
    "report": ("report", "{run}", "--out", "{out}.html"),
    "map": ("map", "{run}", "--out", "{out}"),
    "save": (),
}
WITHIN = ("thesis.tex", "predictions/mine.txt", "stages/thesis/thesis.tex", "stages/labels-0123456789abcdef/000000.npz")
"""What somebody put into the folder of results."""
FAULTS = ("kill", "kill", "kill", "kill", "full", "locked", "link", "race")


class Ground:
    """A recording, its results, and what each command gives undisturbed."""

    def __init__(self, root: Path):
        self.root, self.log, self.run, self.former = root, root / "log", root / "run", root / "whole_former"
        write_bins(lane(N_SCANS).sequence, self.log)
        self.wanted: dict[str, dict[str, bytes]] = {}
        self.lasts: dict[str, float] = {}
        for name, out in [
            ("label", self.run),
            *((name, root / f"whole_{name}") for name in COMMANDS if name != "label"),
        ]:
            began = time.monotonic()
            if code := wait_for(self.start(name, out)):
                raise SystemExit(f"{name} ends with {code} undisturbed")
            self.lasts[name], self.wanted[name] = time.monotonic() - began, contents(out)

    def prepare(self, name: str, out: Path) -> list[Path]:
        """Fill `out` with what a command finds there; return what of it is somebody's."""
        if name != "label over":
            return []
        shutil.copytree(self.former, out)
        theirs = [out / path for path in WITHIN]
        for path in theirs:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("mine")
        return theirs

    def start(self, name: str, out: Path, before: Callable[[], object] = lambda: None) -> int:
        """Run a command in a process of its own, after `before`; return its number."""
        process = os.fork()
        if process:
            return process
        code = 1
        try:
            sink = os.open(self.root / "said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(sink, 1), os.dup2(sink, 2)
            resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
            before()
            places = {"log": self.log, "run": self.run, "out": out}
            sys.argv = ["automos", *(word.format(**places) for word in COMMANDS[name])]
            if name == "save":
                automos.load(self.run).save(out)
            else:
                command_line()
            code = 0
        except InputError:
            code = 2
        except SystemExit as leaving:
            code = leaving.code if isinstance(leaving.code, int) else 0
        finally:
            os._exit(code)


def wait_for(process: int) -> int:
    """Return the exit code of a process, less than 0 where a signal ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def contents(out: Path) -> dict[str, bytes]:
    """Return what a command wrote, but for the times in it."""
    places = [out.with_name(f"{out.name}.html"), *sorted(out.rglob("*"))]
    found = {
        path.relative_to(out.parent).as_posix()[len(out.name) :]: path.read_bytes() for path in places if path.is_file()
    }
    dates = re.compile(rb'"(seconds|made)": ?(\{[^}]*\}|"[^"]*")|\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?[^"<]*')
    return {name: dates.sub(b"", content) for name, content in found.items() if "stages/" not in name}


def try_fault(ground: Ground, name: str, fault: str, rng: random.Random, work: Path) -> str:
    """Do one fault; return in words what was lost or is wrong, nothing where all is well."""
    out, theirs = work / "out", work / "theirs"
    theirs.mkdir(parents=True)
    (theirs / "thesis.tex").write_text("mine")
    within = [] if fault in ("locked", "link") else ground.prepare(name, out)
    strangers = [path for place in (ground.log, theirs) for path in place.rglob("*") if path.is_file()] + within
    before = {path: path.read_bytes() for path in strangers}
    codes: list[int] = []
    match fault:
        case "kill":
            for _ in range(rng.choice((1, 1, 2))):
                process = ground.start(name, out)
                time.sleep(rng.uniform(0.0, 1.05) * ground.lasts[name])
                os.kill(process, signal.SIGKILL)
                wait_for(process)
        case "full":
            size = int(10 ** rng.uniform(1.0, 5.0))
            codes.append(wait_for(ground.start(name, out, lambda: _fill(size))))
        case "locked":
            out.mkdir()
            for place in (out, work):
                place.chmod(0o555)
            codes.append(wait_for(ground.start(name, out, _be_nobody)))
            work.chmod(0o755)
            shutil.rmtree(out)  # empty, unless everybody may write there
        case "link":
            out.symlink_to(theirs)
            codes.append(wait_for(ground.start(name, out)))
            out.unlink()
        case "race":
            codes += [wait_for(each) for each in [ground.start(name, out), ground.start(name, out)]]
    if set(codes) - {0, 2}:
        return f"exit codes {codes}: {(ground.root / 'said').read_text()[-300:]!r}"
    if name in ("label", "label over", "merge", "save") and _passes(out):
        wholes = [ground.wanted[each] for each in (name, *(["former"] if within else []))]
        if _labels(contents(out)) not in map(_labels, wholes):
            return "what is unfinished passes for results"
    if {path: path.read_bytes() for path in before if path.exists()} != before:
        return "somebody's files are not what they were"
    if code := wait_for(ground.start(name, out)):
        return f"run again it ends with {code}: {(ground.root / 'said').read_text()[-300:]!r}"
    if {path: path.read_bytes() for path in before if path.exists()} != before:
        return "somebody's files are not what they were once it ran again"
    for path in within:
        path.unlink()
    found, wanted = contents(out), ground.wanted[name]
    differ = sorted(key for key in found.keys() | wanted.keys() if found.get(key) != wanted.get(key))
    return f"run again it gives other bytes: {differ[:5]}" if differ else ""


def _fill(size: int) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # writing fails, as on a disk that is full
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def _be_nobody() -> None:
    homes = [Path(each).resolve() for each in (os.__file__, automos.__file__)]
    is_open = all(place.stat().st_mode & 0o005 == 0o005 for home in homes for place in home.parents)
    if os.geteuid() == 0 and is_open:  # else nobody could import anything
        os.setgid(NOBODY)
        os.setuid(NOBODY)


def _passes(out: Path) -> bool:
    try:
        result = automos.load(out)
    except InputError:
        return False
    return len(result) == N_SCANS


def _labels(found: dict[str, bytes]) -> dict[str, bytes]:
    return {name: content for name, content in found.items() if name.endswith(".label")}


def disturb(
    n_faults: int, seed: int, tell: Callable[[str], object] = lambda line: None
) -> tuple[Counter[str], list[str]]:
    """Return how often each fault was done, and a line for each after which something is wrong."""
    root, wrong, done = Path(tempfile.mkdtemp(prefix="automos-kills-")), [], Counter[str]()
    root.chmod(0o755)
    try:
        ground = Ground(root)
        for number in range(seed, seed + n_faults):
            rng, work = random.Random(number), root / f"fault{number}"
            commands = (*(each for each in COMMANDS if each != "former"), "label")
            name = commands[number % len(commands)]
            fault = FAULTS[(number + number // len(commands)) % len(FAULTS)]  # in 72 faults every pair of both
            said = try_fault(ground, name, fault, rng, work)
            done[fault] += 1
            if said:
                wrong.append(f"{name}, {fault} {number}: {said}")
                tell(wrong[-1])
            shutil.rmtree(work)
    finally:
        shutil.rmtree(root, ignore_errors=True)
    return done, wrong


def main() -> int:
    """Print what is wrong as it comes, then how often each fault was done; exit code 1 where something is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="number of the first fault")
    chosen = parser.parse_args()
    done, wrong = disturb(chosen.faults, chosen.seed, lambda line: print(line, flush=True))
    print(f"{done.total()} faults ({', '.join(f'{n} {fault}' for fault, n in done.items())}), {len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
