"""A results folder opened together with the recording it was made from, which run.json names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from automos.arguments import given_path
from automos.datasets import open_sequence
from automos.errors import InputError
from automos.results.run_files import RunFiles
from automos.workspace import RUN_FILE, Workspace

SHOWN = 5
"""Folders that are named where another one was given."""


def open_run(
    folder: str | Path,
    recording: str | Path | None = None,
    format: str | None = None,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> RunFiles:
    """Return the results in `folder` with their recording.

    Parameters
    ----------
    recording : where the recording is; not needed while it is where it was when it was labelled.
    format : the recording's format, where guessing fails.

    Raises
    ------
    InputError
        No results in `folder`, no recording where it is looked for, or one of other scans.
    """
    folder = given_path(folder, "a results folder")
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; give the results folder of automos label")
    if recording is not None:
        return RunFiles(folder, open_sequence(recording, format), progress)
    about = Workspace(folder).read_run()
    if not about:
        inner = sorted(path.parent.name for path in folder.glob(f"*/{RUN_FILE}"))
        there = f"; these in it do: {', '.join(inner[:SHOWN])}{' ...' * (len(inner) > SHOWN)}" if inner else ""
        raise InputError(f"{folder} holds no results of automos label ({RUN_FILE} is missing or damaged){there}")
    source = about.get("recording", {}).get("source")
    if source is None:
        raise InputError(f"{folder} does not tell which recording it was made from; give its path after {folder}")
    try:
        sequence = open_sequence(source, format)
    except InputError as error:
        raise InputError(
            f"the recording cannot be opened where it was ({error}); give its path after {folder}"
        ) from error
    return RunFiles(folder, sequence, progress)
