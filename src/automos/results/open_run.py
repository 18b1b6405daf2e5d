"""Open a results folder together with its recording, whose path is stored in run.json."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from automos.core.arguments import given_path
from automos.core.errors import InputError
from automos.core.workspace import RUN_FILE, Workspace
from automos.readers import open_sequence
from automos.results.run_files import RunFiles

SHOWN = 5
"""Number of results folders that the message suggests."""


def open_run(
    folder: str | Path,
    recording: str | Path | None = None,
    format: str | None = None,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> RunFiles:
    """Open a results folder together with its recording.

    Parameters
    ----------
    folder : str or Path
        Results folder written by `automos label`.
    recording : str or Path, optional
        The recording, if it is not where it was when it was labelled.
    format : str, optional
        Format of the recording, if it is not recognised.
    progress : callable, optional
        Called as `progress(what, done, total)` while scans are read.

    Returns
    -------
    RunFiles
        Labels, boxes and poses, scan by scan.

    Raises
    ------
    InputError
        The folder holds no results, the recording is not found, or it has other scans.

    Examples
    --------
    >>> import automos
    >>> run = automos.open_run("automos_runs/my_log")
    >>> labels = run.labels(0, len(run.scan(0)))
    >>> labels.shape == (len(run.scan(0)),)
    True
    """
    folder = given_path(folder, "a results folder")
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the results folder of automos label")
    if recording is not None:
        return RunFiles(folder, open_sequence(recording, format), progress)
    about = Workspace(folder).read_run()
    if not about:
        inner = sorted(path.parent.name for path in folder.glob(f"*/{RUN_FILE}"))
        there = f"; these in it do: {', '.join(inner[:SHOWN])}{' ...' * (len(inner) > SHOWN)}" if inner else ""
        raise InputError(f"{folder} holds no results of automos label ({RUN_FILE} is missing or damaged){there}")
    source = about.get("recording", {}).get("source")
    if source is None:
        raise InputError(f"{folder} does not say which recording it was made from; give its path after {folder}")
    try:
        sequence = open_sequence(source, format)
    except InputError as error:
        raise InputError(
            f"the recording cannot be opened where it was ({error}); give its path after {folder}"
        ) from error
    return RunFiles(folder, sequence, progress)
