"""The folder of a run: the results of each stage, kept so that a second run does only what is missing.

The results of a stage are stored under a fingerprint of their inputs (recording, settings, version, earlier stages),
one file per scan, written under a temporary name and then renamed. So existing files are complete, and results of other
settings are never read.
"""

import json
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, remove_parts, write_json
from automos.core.claims import RESULTS, claim
from automos.core.errors import InputError
from automos.core.reading import DAMAGE, given_path, parsed_again, read_json, require_regular
from automos.core.run_record import RunRecord
from automos.core.stages import Arrays, Stage, Stages, fingerprint

RUN_FILE = "run.json"
COMPLETE = "complete.json"
UNFINISHED = "unfinished"
"""Entry of run.json while labels are written anew to which decisions of a review are still to be applied."""
REVIEWED = "reviewed"
"""Stage that holds the object of each point, of the scans that a review changed; its key is that of the labels."""
RESULT_FILES = ("poses.txt", "poses.tum", "tracks.json", "settings.yaml")
"""What a run's folder holds beside labels, stages and run.json."""
LONGEST_NAME = 230
"""Bytes of a scan's name: systems allow 255, and what is half-written bears a suffix and a random number, too."""


def require_same(name: str, n_points: int, kind: npt.NDArray) -> None:
    """Raise InputError if scan `name` has not as many points of use as (M,) `kind` was found of: it has changed."""
    if n_points != len(kind):
        raise InputError(
            f"scan {name} has {n_points} points of use and had {len(kind)} when it was labelled: label the recording "
            "again, or give the one that the results were made from"
        )


class _FolderStage(Stage):
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder} could not be made ({error.strerror}): choose another --out") from error

    def has(self, name: str) -> bool:
        return (self._folder / f"{name}.npz").exists()

    def save(self, name: str, arrays: Arrays) -> None:
        path = self._folder / f"{name}.npz"
        with atomic_path(path) as temporary:
            with temporary.open("wb") as file:
                np.savez(file, **dict(arrays))  # type: ignore[arg-type]
            with zipfile.ZipFile(temporary, "a") as archive:
                archive.comment = _seal(path, archive)

    def load(self, name: str, *keys: str) -> dict[str, npt.NDArray]:
        path = self._folder / f"{name}.npz"
        try:
            require_regular(path)
            return parsed_again(lambda: _arrays_in(path, keys))
        except (OSError, *DAMAGE) as error:
            raise _damage(path, error) from error


class _Found(dict[str, npt.NDArray]):
    """The arrays in a file; an error that names the file if one is missing."""

    path: Path

    def __missing__(self, key: str) -> npt.NDArray:
        raise _damage(self.path, f"it holds no {key}")


def _damage(path: Path, why: object) -> InputError:
    return InputError(
        f"{path} is damaged ({why}): delete {path.parent} and repeat the command that wrote it (usually automos label)"
    )


def _seal(path: Path, archive: zipfile.ZipFile) -> bytes:
    """Return what binds the sums of all arrays in `archive` to the scan, stage and settings that `path` is of.

    A file that was changed and packed again, or that lies where another belongs, is whole and yet not ours: its
    numbers would be painted on other points, or index what is not there.
    """
    sums = [(member.filename, member.CRC, member.file_size) for member in archive.infolist()]
    return fingerprint(path.parent.name, path.name, sums).encode()


def _arrays_in(path: Path, keys: tuple[str, ...]) -> dict[str, npt.NDArray]:
    with np.load(path, allow_pickle=False) as archive:
        if archive.zip.comment != _seal(path, archive.zip):
            raise ValueError("it is not what this version of automos wrote there")
        found = _Found({key: archive[key] for key in keys or archive.files})
    found.path = path
    return found


def _is_sealed(path: Path) -> bool:
    """Return whether `path` is a file of a stage as we wrote it."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.comment == _seal(path, archive)
    except (OSError, *DAMAGE):
        return False


def _is_file_name(name: str) -> bool:
    try:
        return name == Path(name).name != "" and "\0" not in name and len(name.encode()) <= LONGEST_NAME
    except UnicodeEncodeError:
        return False


class Workspace(Stages):
    """Where the results of a run are kept: a results folder, or memory.

    Parameters
    ----------
    root : str or Path, optional
        The results folder, created at the first write. Results are kept in memory if not given.

    Raises
    ------
    InputError
        `root` cannot be the name of a folder.

    Examples
    --------
    With a workspace, a second call finds the results of the first and does only what is missing:

    >>> import automos
    >>> recording = automos.open_sequence("my_log")
    >>> result = automos.label(recording, workspace=automos.Workspace("kept"), workers=1)
    >>> again = automos.label(recording, workspace=automos.Workspace("kept"), workers=1)
    >>> again.about == result.about
    True
    """

    def __init__(self, root: str | Path | None = None):
        super().__init__()
        self.root = None if root is None else given_path(root, "the folder of a Workspace")

    def __repr__(self) -> str:
        return f"<Workspace {'in memory' if self.root is None else self.root}>"

    def require_names(self, names: list[str], n_scans: int) -> None:
        """Raise InputError if results of `n_scans` scans cannot be kept under `names`: files, if there is a root."""
        super().require_names(names, n_scans)
        unfit = None if self.root is None else next((name for name in names if not _is_file_name(name)), None)
        if unfit is not None:
            raise InputError(
                f"a scan is named {unfit!a:.80} ({len(unfit)} letters), and results are files of that name: give scans "
                f"names of at most {LONGEST_NAME} bytes and without strokes"
            )

    def stage(self, name: str, key: str) -> Stage:
        """Return the stage `name` as made under fingerprint `key`."""
        if self.root is None:
            return super().stage(name, key)
        if not self.root.exists():
            claim(self.root, RESULTS)
        return _FolderStage(self.root / "stages" / f"{name}-{key}")

    def keep_only(self, keys: Mapping[str, str]) -> None:
        """Remove stages made under other fingerprints than `keys` (stage name: fingerprint), and halves of files."""
        if self.root is None:
            return super().keep_only(keys)
        wanted = {f"{name}-{key}" for name, key in keys.items()}
        for folder in (self.root / "stages").glob("*"):
            remove_parts(folder)
            if folder.name not in wanted:
                for path in filter(_is_sealed, folder.glob("*.npz")):
                    path.unlink(missing_ok=True)
                with suppress(OSError):  # something else is in it, or it is a link
                    folder.rmdir()

    def read_run(self) -> dict[str, Any]:
        """Return what run.json says of the run in this folder, {} where there is none or it is damaged."""
        if self.root is None or not (self.root / RUN_FILE).exists():
            return {}
        try:
            run: dict[str, Any] = read_json(self.root / RUN_FILE)
            RunRecord.model_validate(run)
            json.dumps(run, allow_nan=False)  # a number that JSON has not
        except (ValueError, OSError):  # InputError and pydantic's errors are ValueErrors
            return {}  # the run is made again
        return run


def write_run(folder: Path, run: dict[str, Any]) -> None:
    """Write what run.json says of the run in `folder`."""
    write_json(folder / RUN_FILE, run, indent=1)
