"""Hostile values for every option of every command, and lists of recordings."""

import random
import shutil
from pathlib import Path

from calling import LAST, call
from damage import NUMBERS, damage

OPTIONS: dict[str, tuple[str, ...]] = {
    "evaluate": ("--format", "--json"),
    "report": ("--format", "--out"),
    "export": ("--to", "--format", "--out"),
    "merge": ("--out", "--format"),
    "drift": ("--calib",),
    "view": ("--points", "--rrd", "--format"),
    "status": ("--nothing",),
}
_ALONE: tuple[tuple[str, ...], ...] = tuple(
    (command, "{log}", "--out", "{out}", *(("--method", "octomap") if command != "label" else ()), option)
    for command, options in {
        "label": ("--preset", "--settings", "--set", "--format", "--poses", "--calib", "--moving", "--unsure",
                  "--shard", "--memory", "--cache", "--work", "--chunk", "--workers"),
        "compare": ("--method", "--scan", "--radius", "--poses", "--predictions", "--repeat", "--set", "--format"),
        "map": ("--kind", "--method", "--voxel", "--poses", "--calib", "--set", "--format"),
    }.items()
    for option in options
) + tuple(("simulate", "{out}", "--scans", "2", option) for option in (
    "--scenario", "--sensor", "--scans", "--seed", "--convention", "--rig", "--weather", "--lidars"))  # fmt: skip
WORDS = (
    *NUMBERS[:-1], "{log}", "{run}", "{out}", "/dev/null", "/dev/zero", "/proc/self/mem", "/", ".", "..", "a" * 300,
    "a/" * 3000, "x\x1b[31m", "\udcff", "x=y", "=", "a=b=c", "1/0", "0/0", "-1/2", "9/3", "s3://", "file:///x", "http://x",
    "{log}/times.txt", "{log}/velodyne/000000.bin",
)  # fmt: skip


def fuzz_values(bases: Path, rng: random.Random, work: Path) -> None:
    """Give a command one hostile value; what could take long is cut short by a recording that is not there."""
    *words, option = rng.choice(_ALONE)
    root = work / "case"
    shutil.copytree(bases / "run", root / "run")
    (root / "log").mkdir()  # nothing is in it: values are told before anything is begun, or the folder is refused
    if rng.random() < 0.3:
        shutil.copytree(bases / "log", root / "log", dirs_exist_ok=True)
        for path in sorted((root / "log" / "velodyne").iterdir())[3:]:
            path.unlink()
    given = [filled(word, root) for word in (*words, option, rng.choice(WORDS))]
    LAST.append(str(given))
    call(*given)


def fuzz_list(bases: Path, rng: random.Random, work: Path) -> None:
    """Give a list of recordings with one line or byte changed; what would be done is said, nothing is."""
    names = ["logs/a", "# all of them", "logs/b", "log", rng.choice(WORDS).replace("{log}", "log")]
    (work / "list").mkdir()
    path = work / "list" / "list.txt"
    path.write_text("".join(f"{bases / name}\n" for name in names), errors="surrogateescape")
    LAST.append(f"{names[-1][:50]!r}, {damage(work / 'list', rng)}")
    call("label", path, "--dry-run")


def filled(word: str, root: Path) -> str:
    for name in ("log", "run", "out"):
        word = word.replace(f"{{{name}}}", str(root / name))
    return word
