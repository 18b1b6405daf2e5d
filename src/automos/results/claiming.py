"""Checks whether a folder may be written to: whose results it holds, and whether another process is writing.

An unfinished run of ours is recognised by its folder `stages`, which exists before the first label does.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from automos.core.arguments import require_own_names
from automos.core.atomic import faults_reported, held, remove_parts
from automos.core.errors import InputError
from automos.core.scan import Sequence
from automos.core.workspace import RESULT_FILES, RUN_FILE, Workspace
from automos.readers.codecs import read_columns
from automos.readers.files import holds_scans, list_scans

PER_SCAN = ("predictions/*.label", "confidences/*.npy", "probabilities/*.npy")
"""What a results folder holds of every scan."""


def require_room(folder: Path, recording: Sequence | None) -> None:
    """Raise InputError where results must not go into `folder`: it is another program's, or holds a recording.

    Or where they cannot, since a scan has a name that no file can have.
    """
    refuse_foreign(folder)
    if recording is not None:
        Workspace(folder).require_names(recording.names, len(recording))
        refuse_folders_of(recording, folder)
    refuse_results(folder)
    refuse_scans(folder)


def refuse_foreign(folder: Path) -> None:
    """Raise InputError where `folder` holds labels, poses or the like that no run of ours wrote and we would replace.

    Ours has run.json or, until it has ended, stages.
    """
    for place in (folder, folder / "predictions"):
        if place.exists() and not place.is_dir():
            raise InputError(f"{place} is a file: choose another --out")
    if not _is_ours(folder) and any((folder / "predictions").glob("*.label")):
        raise InputError(f"{folder}/predictions holds labels that another program wrote: choose another --out")
    for inner in ("confidences", "probabilities"):
        if not _is_ours(folder) and any((folder / inner).glob("*.npy")):
            raise InputError(f"{folder / inner} holds files that another program wrote: choose another --out")
    for name in RESULT_FILES:
        if not _is_ours(folder) and (folder / name).exists():
            raise InputError(f"{folder / name} was not written by automos label: choose another --out")


def refuse_scans(folder: Path) -> None:
    """Raise InputError where `folder` is some recording's, whose truth our poses would be taken for."""
    places = (place for place in (folder, folder / "velodyne") if place.is_dir())
    if not _is_any_of_ours(folder) and any(map(holds_scans, places)):
        raise InputError(f"{folder} holds the scans of a recording: choose another --out")


def refuse_unrepeatable(folder: Path) -> None:
    """Raise InputError where nothing makes the labels in `folder` again: they were corrected, or a sensor's."""
    if (folder / "merge.json").exists():
        raise InputError(f"{folder} holds labels corrected by automos merge, which would be lost: choose another --out")
    if Workspace(folder).read_run().get("recording", {}).get("is_sensor"):
        raise InputError(f"{folder} holds labels of what a sensor sent, which would be lost: choose another --out")


def refuse_others_results(folder: Path, sequence: Sequence) -> None:
    """Raise InputError where `folder`, which nobody chose, holds the results of another recording that is still there.

    Recordings of one name (`data`, `velodyne`) would have one default folder, and the second run would replace what the
    first found, and what a person decided of it.
    """
    was = Workspace(folder).read_run().get("recording", {}).get("source")
    if was is None or sequence.address is None or not os.path.exists(was):
        return
    if os.path.realpath(was) != os.path.realpath(sequence.address):
        raise InputError(f"{folder} holds the results of {was}, another recording of that name: choose another --out")


def results_folders(recordings: list[Sequence], out: Path | None, default: Path) -> list[Path]:
    """Return the results folder of each recording: `out` itself for one, else a folder of its name in it, or `default`.

    Raises
    ------
    InputError : two are named alike, or nobody chose the folder, and it holds results of another recording.
    """
    require_own_names([sequence.name for sequence in recordings])
    if out is not None and len(recordings) == 1:
        return [out]
    folders = [(out or default) / sequence.name for sequence in recordings]
    if out is None:
        for folder, sequence in zip(folders, recordings, strict=True):
            refuse_others_results(folder, sequence)
    return folders


def refuse_inner(folder: Path, names: Iterable[str]) -> None:
    """Raise InputError where `folder` holds folders of `names`, which we would write anew, and none of them is ours."""
    taken = next((name for name in names if (folder / name).exists()), None)
    if taken is not None and not _is_any_of_ours(folder):
        raise InputError(f"{folder / taken} was not written by automos and would be replaced: choose another --out")


def refuse_anyones(folder: Path) -> None:
    """Raise InputError where an export must not go into `folder`: it holds scans or labels that no export of ours is.

    Some other recording would get points of ours among its scans, or lose the labels that it came with.
    """
    if not folder.is_dir() or _is_any_of_ours(folder):
        return
    if _holds_others_scans(folder) or _holds_others_scans(folder / "velodyne"):
        raise InputError(f"{folder} holds the scans of a recording: choose another --out")
    beside = (folder.parent, folder.parent / "velodyne")
    if any(folder.glob("*.label")) and not _is_any_of_ours(folder.parent) and any(map(_holds_others_scans, beside)):
        raise InputError(f"{folder} holds the labels of a recording: choose another --out")


def _holds_others_scans(folder: Path) -> bool:
    """Return whether `folder` holds scans; points that we exported have columns for their label and object."""
    if not folder.is_dir() or not holds_scans(folder):
        return False
    try:
        files, codec, _ = list_scans(folder)
    except InputError:
        return True  # of several kinds, or damaged
    if codec == "bin":
        return True
    try:
        columns = read_columns(folder / files[0], codec)
    except InputError:
        return codec != "npy"  # objects of points, which `--to instances` writes, are no points
    return not {"label", "instance"} <= columns.keys()


def refuse_results(folder: Path) -> None:
    """Raise InputError where `folder` is one that a run's labels lie in: corrections may be among them."""
    if folder.name in {Path(pattern).parts[0] for pattern in PER_SCAN} | {"stages"} and _is_ours(folder.parent):
        raise InputError(f"{folder} holds the results of a run: choose another --out")


def refuse_folders_of(sequence: Sequence, folder: Path) -> None:
    """Raise InputError where `folder` is the recording's own or came with it.

    Our poses would be read as its truth, and points in another format would take the place of its scans.
    """
    if sequence.source is None or not sequence.source.is_dir():
        return
    source, target = (Path(os.path.realpath(place)) for place in (sequence.source, folder))  # links in circles included
    below = [place for place in (target, *target.parents) if source in place.parents]
    came_with_it = bool(below) and target.is_dir() and any(target.iterdir()) and not any(map(_is_any_of_ours, below))
    if target == source or came_with_it:
        or_else = ", or remove what is in it, if that did not come with the recording" if came_with_it else ""
        raise InputError(f"{folder} is a folder of the recording {sequence.name}: choose another --out{or_else}")


def refuse_file_of(sequence: Sequence, path: Path) -> None:
    """Raise InputError where file `path`, which would be replaced, is one of the recording and no page or scores."""
    place, source = (Path(os.path.realpath(p)) for p in (path, sequence.source or os.devnull))
    if path.is_file() and source in (place, *place.parents) and path.suffix not in (".html", ".json"):
        raise InputError(f"{path} is a file of the recording {sequence.name}: give the name of another one")


def _is_any_of_ours(folder: Path) -> bool:
    """Return whether a command of ours wrote into `folder`, or began to: label, segment, compare or map."""
    return _is_ours(folder) or any((folder / name).exists() for name in ("compare.json", "map.json", "poses/stages"))


def _is_ours(folder: Path) -> bool:
    return (folder / RUN_FILE).exists() or (folder / "stages").exists()


@contextmanager
def claimed(folder: Path, places: list[str], recording: Sequence | None) -> Iterator[None]:
    """Hold the results folder of what labels scan by scan (`automos segment`, `live`), emptied, until the block ends.

    Where the block does not end, the folder is known to be ours and unfinished: the same command may be run again.

    Parameters
    ----------
    places : folders in it that are made.
    recording : where one is labelled; its own folder is not written into. None of a sensor: no labels are replaced.

    Raises
    ------
    InputError : the folder holds what other commands or programs wrote, another process writes, or writing fails.
    """
    stages = folder / "stages"
    with held(folder):
        if any(stages.glob("*")):
            raise InputError(f"{folder} holds labels that automos segment did not write: choose another --out")
        refuse_unrepeatable(folder)
        require_room(folder, recording)
        if recording is None and any(folder.glob(PER_SCAN[0])):
            raise InputError(f"{folder} holds labels of an earlier run, which would be lost: choose another --out")
        with faults_reported(folder):
            stages.mkdir(exist_ok=True)
            for name in (RUN_FILE, *RESULT_FILES):
                (folder / name).unlink(missing_ok=True)
            for stale in (path for pattern in PER_SCAN for path in folder.glob(pattern)):
                stale.unlink()
            for place in (folder, *(folder / name for name in places)):
                place.mkdir(exist_ok=True)
                remove_parts(place)
        yield
        with suppress(OSError):
            stages.rmdir()
