"""What is ours: nothing is replaced or deleted that this program did not write.

A folder that a command fills is new, empty but for folders of ours, or bears our mark, a file `.automos` that says what
it holds. A file that the user names is new, empty, or has a sign in it that only we write there. Through links, too:
what a folder of ours leads to through a link within it is ours only if it bears a mark of its own.
"""

import json
import mmap
import os
from pathlib import Path
from typing import Any

from automos.core.errors import InputError
from automos.core.reading import read_json

MARK = ".automos"
SIGN = b"written by automos"
"""In files of ours, by which they are known."""
RESULTS, METHODS, EXPORT, SIMULATION, RECORDED = "results", "a comparison", "an export", "a simulation", "a recording"
TRAINING, EXPERIMENT, DEMO, LEDGER = "a training", "an experiment", "a demo", "a ledger"
COPIES, SCRATCH = "copies of recordings", "what is in the making"
DATASET, CLEANED = "a data set", "a recording without movers"
_BEFORE_MARKS = {
    "run.json": (RESULTS, {"recording", "points", "versions"}),
    "compare.json": (METHODS, {"recording", "n_scans", "poses", "methods", "missing", "agreement"}),
    "simulation.json": (SIMULATION, {"format", "scenario", "sensor", "scans", "seed"}),
    "convention.json": (RECORDED, {"turns", "order", "times", "reference", "lost_packets"}),
}
"""What version 0.6.0 left, which had no marks: files, what a folder with one holds, and keys that all of them have."""


def claim(folder: Path, holds: str) -> None:
    """Make `folder` ours, for what it `holds`: `RESULTS` or the like.

    Raises
    ------
    InputError : it is no folder, holds what this program did not write or wrote as something else, or cannot be made.
    """
    if folder.exists() and not folder.is_dir():
        kind = "a file" if folder.is_file() else "a device, a pipe or the like"
        raise InputError(f"{folder} is {kind}: choose another --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        found = held_by(folder)
        names = sorted(set(os.listdir(folder)) - {MARK})
        theirs = next((name for name in names if held_by(folder / name) is None), None)
        if found is None and theirs is not None and not _is_in_old_export(folder):
            raise InputError(f"{folder} holds {theirs}, and automos did not make that folder: choose another --out")
        if found not in (None, holds):
            raise InputError(f"{folder} holds {found} that automos wrote: choose another --out")
        if not _marked(folder):
            (folder / MARK).write_text(mark_of(holds))
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror or error}): choose another --out") from error


def mark_of(holds: str) -> str:
    """Return what is in the mark of a folder that `holds` something."""
    return json.dumps({"by": "automos", "holds": holds}) + "\n"


def claim_file(path: Path, sign: bytes = SIGN) -> None:
    """Raise InputError where `path`, which is to be written, is there and has no `sign` of ours in it."""
    if not os.path.lexists(path):
        return
    if path.is_dir() or (path.exists() and not path.is_file()):
        kind = "a folder" if path.is_dir() else "a device, a pipe or the like"
        raise InputError(f"{path} is {kind}: give the name of a file to write")
    if not (path.is_file() and (_has(path, sign) or _is_in_old_export(path))):
        raise InputError(f"{path} is there, and automos did not write it: give the name of another file")


def require_within(path: Path) -> None:
    """Raise InputError where `path` lies in a folder of ours, but leads through a link to one that is not."""
    lexical, real = Path(os.path.abspath(path.parent)), Path(os.path.realpath(path.parent))
    if lexical != real and _ours_above(lexical) and not _ours_above(real):
        raise InputError(f"{path} leads to {real}, and automos did not make that folder: choose another --out")


def remove(path: Path) -> None:
    """Remove file `path` from a folder of ours, if it is there; errors as of `require_within`."""
    if os.path.lexists(path):
        require_within(path)
        path.unlink()


def held_by(folder: Path) -> str | None:
    """Return what the folder of ours holds, None where it is not known to be ours."""
    return _marked(folder) or next((holds for name, (holds, _) in _BEFORE_MARKS.items() if _is_old(folder, name)), None)


def is_run_record(content: object) -> bool:
    """Return whether `content`, of a run.json, is what only we write there."""
    return isinstance(content, dict) and _has_keys(content, "run.json")


def _marked(folder: Path) -> str | None:
    mark = _json_in(folder / MARK)
    return str(mark.get("holds")) if mark.get("by") == "automos" else None


def _is_old(folder: Path, name: str) -> bool:
    return _has_keys(_json_in(folder / name), name)


def _has_keys(content: dict[str, Any], name: str) -> bool:
    versions = content.get("versions", {"automos": ""})
    return _BEFORE_MARKS[name][1] <= content.keys() and isinstance(versions, dict) and "automos" in versions


def _json_in(path: Path) -> dict[str, Any]:
    try:
        found = read_json(path) if path.exists() else {}
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _is_in_old_export(path: Path) -> bool:
    """Return whether `path` is where `automos export` writes by default, in a run's own folder `export`."""
    return any(place.name == "export" and held_by(place.parent) == RESULTS for place in path.parents)


def _ours_above(folder: Path) -> bool:
    return any(held_by(place) is not None for place in (folder, *folder.parents))


def _has(path: Path, sign: bytes) -> bool:
    if path.stat().st_size == 0:
        return True  # nothing is lost
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return content.find(sign) >= 0
