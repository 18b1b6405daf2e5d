"""What sequences of data sets and folders derive from: scans with names and times, each in a file of its own."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.scan import Scan, Sequence
from automos.readers.columns import Columns, to_scan
from automos.readers.files import is_text
from automos.readers.formats import digest_of_files, require_increasing


class NamedSequence(Sequence):
    """Scans with names and, where the recording has a clock, times; readers derive from it, and set both."""

    source: Path
    stamps: Array | None = None
    """(len,) seconds or None."""
    _names: list[str]

    def __len__(self) -> int:
        return len(self._names)

    @property
    def names(self) -> list[str]:
        """One name per scan."""
        return self._names


class FileSequence(NamedSequence):
    """Such a sequence that has a file for each scan."""

    paths: list[Path]
    """The file of each scan."""

    def _to_scan(self, index: int, columns: Columns, *how: Any) -> Scan:
        """Return scan `index` of the `columns` in its file; `how` is what `to_scan` takes behind the stamp."""
        stamp = None if self.stamps is None else float(self.stamps[index])
        return to_scan(columns, self.paths[index], self._names[index], stamp, *how)


class ListedSequence(FileSequence):
    """Such a sequence whose files are known from the start; readers say how one is read."""

    stamps: Array = np.zeros(0)

    def __init__(self, source: Path, files: list[Path], stamps: npt.ArrayLike, name: str | None = None):
        """Take the scans' files in time order, named by what stands before the first dot, and stamps in seconds.

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
        self.paths = files
        self._names = [file.name.partition(".")[0] for file in files]
        twice = next((name for name, count in Counter(self._names).items() if count > 1), None)
        if twice is not None:
            raise InputError(
                f"{source} has two scans named {twice}, whose labels would have one name; remove one of them"
            )
        self.stamps = np.asarray(stamps, np.float64)
        require_increasing(self.stamps, self._names, source)

    def fingerprint(self) -> str:
        """Return a text that changes when a file's name, size or time of change does, or the stamps."""
        return f"{super().fingerprint()}:{digest_of_files(self.paths, self.stamps.tobytes())}"


def stamped_files(folder: Path, suffix: str, unit: float = 1e-9) -> tuple[list[Path], Array]:
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
