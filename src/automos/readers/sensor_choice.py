"""One sensor of several in a file, named as if the file were a folder: `drive.pcap/SENSOR`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from automos.core.errors import InputError


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
