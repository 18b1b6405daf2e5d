"""Sequences whose format fixes the kind of its files: one file per scan, listed once, read when asked for."""

import hashlib
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import Sequence as ScanSequence
from automos.readers.files import is_text


class ListedSequence(ScanSequence):
    """Scans in files; readers derive from it and say how one is read."""

    source: Path

    def __init__(
        self,
        source: Path,
        files: Sequence[Path],
        names: Sequence[str] | None = None,
        stamps: npt.ArrayLike | None = None,
        name: str | None = None,
    ):
        """Take the scans' files in time order, their names (none: the files' stems) and stamps in seconds.

        Raises
        ------
        InputError
            No files, or stamps that do not increase.
        """
        stray = next((file for file in files if not is_text(file.name)), None)
        if stray is not None:
            raise InputError(f"{source} holds a scan whose name is not UTF-8, {stray.name!a}; rename it")
        if not files:
            raise InputError(f"{source} holds no scans; check that it was copied or downloaded whole")
        self.source = source
        self.name = name or source.resolve().name
        self._files = list(files)
        self._names = [file.stem for file in files] if names is None else list(names)
        twice = next((name for name, count in Counter(self._names).items() if count > 1), None)
        if twice is not None:
            raise InputError(
                f"{source} has two scans named {twice}, whose labels would have one name; remove one of them"
            )
        self._stamps = None if stamps is None else np.asarray(stamps, np.float64)
        if self._stamps is not None:
            require_increasing(self._stamps, self._names, source)

    def __len__(self) -> int:
        return len(self._files)

    @property
    def names(self) -> list[str]:
        """One name per scan."""
        return self._names

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds or None."""
        return self._stamps

    def fingerprint(self) -> str:
        """Return a text that changes when a file's name, size or time of change does, or the stamps."""
        stamps = b"" if self._stamps is None else self._stamps.tobytes()
        return f"{super().fingerprint()}:{digest_of_files(self._files, stamps)}"


def stamped_files(folder: Path, suffix: str, unit: float = 1e-9) -> tuple[list[Path], npt.NDArray[np.float64]]:
    """Return the files of `folder` that are named by their time alone, in order of it, and those times in seconds.

    Raises
    ------
    InputError
        A file of another name.
    """
    files = [path for path in folder.glob(f"*{suffix}") if not path.name.startswith(".")]
    stray = next((path for path in files if not (path.stem.isascii() and path.stem.isdecimal())), None)
    if stray is not None:
        raise InputError(f"{stray} is not named by its time; {folder} must hold only scans that are")
    files.sort(key=lambda path: int(path.stem))
    return files, unit * np.array([int(path.stem) for path in files], np.float64)


def digest_of_files(files: Iterable[Path], *more: bytes) -> str:
    """Return a text that changes when the name, size or time of change of any of `files` does, or `more`.

    Raises
    ------
    InputError
        One of them is absent.
    """
    digest = hashlib.sha256()
    for file in files:
        try:
            status = file.stat()
        except OSError as error:
            raise InputError(f"{file} cannot be read: {error.strerror}; the recording is not whole") from None
        digest.update(os.fsencode(f"{file.name}\0{status.st_size}\0{status.st_mtime_ns}\n"))  # names are any bytes
    for part in more:
        digest.update(part)
    return digest.hexdigest()


def require_increasing(stamps: npt.NDArray[np.float64], names: Sequence[str], where: Path) -> None:
    """Raise where `stamps` (N,) in seconds repeat or run backwards; `names` and `where` are for the message.

    Raises
    ------
    InputError
        A scan is not later than the one before it.
    """
    is_late = ~(np.diff(stamps) > 0)
    if is_late.any():
        late = int(np.argmax(is_late)) + 1
        raise InputError(
            f"{where}: scan {names[late]} at {stamps[late]:.6f} s is not after the one before it "
            f"({stamps[late - 1]:.6f} s); the recording's clock repeats or runs backwards: correct its times"
        )
