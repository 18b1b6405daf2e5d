"""What a reader declares of itself, how it finds recordings, and what those of several sensors in a file share.

A sensor's sequence is one of those in a file, named as if the file were a folder: `drive.pcap/SENSOR`.
"""

import hashlib
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.reading import damage_reported
from automos.core.scan import Sequence as ScanSequence


@dataclass(frozen=True)
class Format:
    """A format of recordings: `FORMAT` of each module that reads one, or in its `FORMATS`.

    Attributes
    ----------
    layout : what its recordings look like on disk, in one line; up to a colon or semicolon, what they are.
    find : returns the recordings of this format at a path, none where it is of another. Needs no optional package.
    open : returns one of them; takes the path and, where `has_codecs`, the codec the user asked for or None.
    truth : where labels to compare with come from; empty where it has none.
    needs : the extra to install, None where the core suffices.
    has_codecs : whether its scans are point files of any of the kinds in `codecs`.
    """

    layout: str
    find: Callable[[Path], list[Path]]
    open: Callable[..., ScanSequence]
    truth: str = ""
    needs: str | None = None
    has_codecs: bool = False


def recordings_at(path: Path, is_recording: Callable[[Path], bool]) -> list[Path]:
    """Return `path` if it is a recording, else those that lie in it, by name."""
    return [path] if is_recording(path) else recordings_in(path, is_recording)


def recordings_in(folder: Path, is_recording: Callable[[Path], bool]) -> list[Path]:
    """Return the recordings that lie in a folder, by name."""
    return sorted(filter(is_recording, folder.iterdir())) if folder.is_dir() else []


def digest_of_files(files: Iterable[Path], *more: bytes, kind: str = "") -> str:
    """Return a text that changes when the name, size or time of change of any of `files` does, their `kind`, or `more`.

    Raises
    ------
    InputError
        One of them is absent.
    """
    digest = hashlib.sha256(kind.encode())
    for file in files:
        with damage_reported(file):
            status = file.stat()
        digest.update(os.fsencode(f"{file.name}\0{status.st_size}\0{status.st_mtime_ns}\n"))  # names are any bytes
    digest.update(b"".join(more))
    return digest.hexdigest()


def require_increasing(stamps: Array, names: Sequence[str], where: Path) -> None:
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


CAPTURES = (".pcap", ".pcapng")
"""What the names of captures end in."""


def is_capture(path: Path) -> bool:
    """Return whether a file has the name of a capture."""
    return path.suffix.lower() in CAPTURES and path.is_file()


class SensorSequence(ScanSequence):
    """The sweeps of one sensor, as measured; readers derive from it, find them, and set `stamps` and `_identity`."""

    is_compensated = False
    """Packets are as measured."""

    source: Path
    address: Path | None = None
    """The file, or the sensor that was asked for below it."""
    stamps: Array = np.zeros(0)
    """(len,) seconds, of each sweep's first packet on the sensor's clock, which may be set to the recorder's."""
    _identity: str

    def __init__(self, path: Path):
        """Take the file at `path`, or the one that `path` names a sensor below."""
        self.address = path
        self.source, self._wanted = split_sensor(path)
        self.name = self.source.stem if self._wanted is None else f"{self.source.stem}_{self._wanted}"

    def _set_stamps(self, stamps: npt.ArrayLike) -> None:
        """Take (len,) the times of the sweeps; InputError unless they increase."""
        self.stamps = np.asarray(stamps, np.float64)
        require_increasing(self.stamps, self.names, self.source)

    def __len__(self) -> int:
        return len(self.stamps)

    def fingerprint(self) -> str:
        """Return a text that changes when the files do, or the sensor."""
        return f"{super().fingerprint()}:{self._identity}:{digest_of_files(self._files())}"

    def _files(self) -> list[Path]:
        return [self.source]


def split_sensor(path: Path) -> tuple[Path, str | None]:
    """Return the file at `path` and None, or the file that `path` lies below and the sensor named there."""
    return (path, None) if path.exists() else (path.parent, path.name)


def choose_sensor(file: Path, wanted: str | None, sensors: Sequence[str], kind: str) -> str:
    """Return which of the `sensors` (at least one) in `file` to read: the one `wanted`, else the only one.

    Raises
    ------
    InputError
        There is no such sensor, or none is wanted and there are several; `kind`, "Velodyne", is what they are called.
    """
    listed = ", ".join(sensors)
    if wanted is not None and wanted not in sensors:
        raise InputError(f"{file} has no {kind} {wanted}; it has: {listed}")
    if wanted is None and len(sensors) > 1:
        raise InputError(f"{file} has {len(sensors)} {kind}s ({listed}); give one, as {file / sensors[0]}")
    return wanted or sensors[0]
