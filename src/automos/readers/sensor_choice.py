"""The scans of one sensor of those in a file, named as if the file were a folder: `drive.pcap/SENSOR`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import Sequence as ScanSequence
from automos.readers.listed import digest_of_files

CAPTURES = (".pcap", ".pcapng")
"""What the names of captures end in."""


def is_capture(path: Path) -> bool:
    """Return whether a file has the name of a capture."""
    return path.suffix.lower() in CAPTURES and path.is_file()


class SensorSequence(ScanSequence):
    """The sweeps of one sensor, as measured; readers derive from it, find them, and set `_stamps` and `_identity`."""

    source: Path
    _stamps: npt.NDArray[np.float64]
    _identity: str

    def __init__(self, path: Path):
        """Take the file at `path`, or the one that `path` names a sensor below."""
        self._address = path
        self.source, self._wanted = split_sensor(path)
        self.name = self.source.stem if self._wanted is None else f"{self.source.stem}_{self._wanted}"

    @property
    def address(self) -> Path:
        """The file, or the sensor that was asked for below it."""
        return self._address

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds, of each sweep's first packet on the sensor's clock, which may be set to the recorder's."""
        return self._stamps

    @property
    def is_compensated(self) -> bool:
        """Packets are as measured."""
        return False

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
