"""Open a results folder together with its recording, whose path is stored in run.json."""

from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from automos.core.errors import InputError
from automos.core.reading import damage_reported, given_path, read_json
from automos.core.run import Progress, silent
from automos.core.scan import Scan, Sequence
from automos.core.workspace import RUN_FILE, Workspace
from automos.readers import open_sequence
from automos.results.run_files import RunFiles

SHOWN = 5
"""Number of results folders that the message suggests."""


def open_run(
    folder: str | Path,
    recording: str | Path | None = None,
    format: str | None = None,
    progress: Progress = silent,
    deskewed: bool = False,
) -> RunFiles:
    """Open a results folder together with its recording, for commands: `automos.load` is what users call.

    progress : called as `progress(what, done, total)` while scans are read.
    deskewed : whether exported points are motion-compensated; InputError if the run does not say how.

    Raises
    ------
    InputError
        The folder holds no results, the recording is not found, or it has other scans.
    """
    return RunFiles(
        Path(folder), recording_of(given_path(folder, "a results folder"), recording, format), progress, deskewed
    )


def recording_of(folder: Path, recording: str | Path | None = None, format: str | None = None) -> Sequence:
    """Return the recording that the results in `folder` were made from; errors as of `open_run`."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the results folder of automos label")
    if recording is not None:
        return open_sequence(recording, format)
    about = Workspace(folder).read_run()
    if not about:
        inner = sorted(path.parent.name for path in folder.glob(f"*/{RUN_FILE}"))
        there = f"; these in it do: {', '.join(inner[:SHOWN])}{' ...' * (len(inner) > SHOWN)}" if inner else ""
        raise InputError(f"{folder} holds no results of automos label ({RUN_FILE} is missing or damaged){there}")
    source = about.get("recording", {}).get("source")
    if source is None:
        raise InputError(f"{folder} does not say which recording it was made from: give its path, too")
    try:
        return open_sequence(source, format)
    except InputError as error:
        raise InputError(f"the recording cannot be opened where it was ({error}): give its path, too") from error


def runs_in(
    results: Path, sequences: Collection[Sequence], is_wanted: Callable[[Sequence], bool]
) -> Iterator[RunFiles]:
    """Yield the runs of those of `sequences` that are wanted and have poses and tracks; labels alone are no run.

    results : the results folder of one recording, or of several a folder with that of each in it.
    """
    for sequence in sequences:
        folder = results if len(sequences) == 1 else results / sequence.name
        if (folder / "tracks.json").exists() and (folder / "poses.txt").exists() and is_wanted(sequence):
            yield RunFiles(folder, sequence)


class Elsewhere(Sequence):
    """A recording that cannot be read: the names of its scans, and why."""

    def __init__(self, folder: Path, why: str):
        """Take the results folder."""
        self.name, self._why = str(Workspace(folder).read_run().get("recording", {}).get("name", folder.name)), why
        with damage_reported(folder / "tracks.json", "does not name the scans"):
            self._names = [str(name) for name in read_json(folder / "tracks.json")["scans"]]

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, index: int) -> Scan:
        raise InputError(self._why)

    @property
    def names(self) -> list[str]:
        """As the run has them."""
        return self._names
