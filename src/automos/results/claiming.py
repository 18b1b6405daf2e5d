"""Checks whether results may be written to a folder of ours: whose they are, and whether another process is writing."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from automos.core.arguments import require_own_names
from automos.core.atomic import faults_reported, held, remove_parts
from automos.core.claims import RESULTS, claim, remove
from automos.core.errors import InputError
from automos.core.scan import Sequence
from automos.core.workspace import RESULT_FILES, RUN_FILE, Workspace
from automos.readers.files import holds_scans

PER_SCAN = ("predictions/*.label", "confidences/*.npy", "probabilities/*.npy")
"""What a results folder holds of every scan."""


def per_scan_files(folder: Path) -> list[Path]:
    """Return the files that `folder` holds of each scan."""
    return [path for pattern in PER_SCAN for path in folder.glob(pattern)]


def require_room(folder: Path, recording: Sequence | None) -> None:
    """Claim `folder` for results; InputError where it is not ours, or a scan has a name that no file can have."""
    if recording is not None:
        Workspace(folder).require_names(recording.names, len(recording))
    claim(folder, RESULTS)


def refuse_scans(folder: Path) -> None:
    """Raise InputError where `folder`, in which results would lie in folders of their own, is some recording's."""
    if any(holds_scans(place) for place in (folder, folder / "velodyne") if place.is_dir()):
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


def refuse_folder_of(sequence: Sequence, folder: Path) -> None:
    """Raise InputError where `folder` is the recording's own: points in another format would be read as its scans."""
    if sequence.source is not None and os.path.realpath(sequence.source) == os.path.realpath(folder):
        raise InputError(f"{folder} is the folder of the recording {sequence.name}: choose another --out")


@contextmanager
def claimed(folder: Path, places: list[str], recording: Sequence | None) -> Iterator[None]:
    """Hold the results folder of what labels scan by scan (`automos segment`, `live`), emptied, until the block ends.

    Parameters
    ----------
    places : folders in it that are made.
    recording : where one is labelled; its own folder is not written into. None of a sensor: no labels are replaced.

    Raises
    ------
    InputError : the folder holds what other commands or programs wrote, another process writes, or writing fails.
    """
    with held(folder):
        if any((folder / "stages").glob("*")):
            raise InputError(f"{folder} holds labels that automos segment did not write: choose another --out")
        refuse_unrepeatable(folder)
        require_room(folder, recording)
        if recording is None and any(folder.glob(PER_SCAN[0])):
            raise InputError(f"{folder} holds labels of an earlier run, which would be lost: choose another --out")
        with faults_reported(folder):
            for stale in [*(folder / name for name in (RUN_FILE, *RESULT_FILES)), *per_scan_files(folder)]:
                remove(stale)
            for name in places:
                (folder / name).mkdir(exist_ok=True)
            remove_parts(folder)
        yield
