"""LAS and LAZ files, as surveyors write them, one sweep each, in the sensor's frame.

What unpacks LAZ (lazrs) calls itself without end on some damaged files, which no process survives: another one does it.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.reading import damage_reported
from automos.readers.apart import read_apart
from automos.readers.columns import Columns
from automos.readers.foreign import limited
from automos.readers.las_header import Promise, is_packed, require_whole

_LAST = 64
"""Bytes at the end of packed points that are given one by one, to see how many of them are needed."""
_SPARE = 2
"""Bytes that packers may write behind the last point."""


def read(path: Path) -> Columns:
    """Return x, y, z, intensity, `time` (the GPS time) and the extra dimensions of one file.

    Raises
    ------
    InputError
        A damaged file.
    """
    import_extra("laspy", "las")
    if not is_packed(path):
        return read_here(path)
    import_extra("lazrs", "las")
    return read_apart("las", path)


def read_here(path: Path) -> Columns:
    """Return what `read` does, read in this process."""
    laspy = import_extra("laspy", "las")
    with damage_reported(path, "is not a complete LAS file", kinds=Exception), limited(path):
        promise = require_whole(path)
        las = laspy.read(path) if promise.packed is None else _unpack(path, promise)
    if len(las) != promise.n_points:
        raise InputError(
            f"{path} is cut short: {len(las)} points, its header promises {promise.n_points}; copy it again"
        )
    names = set(las.point_format.dimension_names)
    told = {"intensity": "intensity", "time": "gps_time"}
    told = {column: name for column, name in told.items() if name in names}
    told |= {name: name for name in las.point_format.extra_dimension_names if las[name].ndim == 1}
    columns: Columns = {axis: np.asarray(las[axis], np.float64) for axis in "xyz"}
    return columns | {column: np.asarray(las[name]) for column, name in told.items()}


class _Watched(io.FileIO):
    """A file that knows up to which byte its packed points were asked for, and whether beyond."""

    def __init__(self, path: Path, begin: int, end: int):
        super().__init__(path)
        self._begin, self._end, self.reached = begin, end, begin
        self.is_exceeded = False

    def readinto(self, buffer: Any) -> int:
        at = self.tell()
        if not self._begin <= at < self._end:
            self.is_exceeded |= at >= self._end and self.reached > self._begin  # what is behind is read before them
            return super().readinto(buffer) or 0
        n = super().readinto(memoryview(buffer)[: max(self._end - _LAST - at, 1)]) or 0
        self.reached = max(self.reached, at + n)
        return n


def _unpack(path: Path, promise: Promise) -> Any:
    """Return what laspy reads of a LAZ file whose chunks do not say how many points are in them.

    Raises
    ------
    InputError
        The last one holds more than its header promises, or fewer: packed points are as long as they need be.
    """
    laspy = import_extra("laspy", "las")
    assert promise.packed is not None
    begin, end = promise.packed
    backend = laspy.LazBackend.Lazrs
    with _Watched(path, begin, end) as file, laspy.open(file, laz_backend=backend, closefd=False) as reader:
        las = laspy.read(path) if promise.n_before else reader.read()
        if promise.n_before:  # several chunks are unpacked at a time, the last one again
            reader.seek(promise.n_before)
            reader.read_points(promise.n_points - promise.n_before)
        is_begun = file.reached > begin or promise.n_points == 0
        if file.is_exceeded or (is_begun and file.reached < end - _SPARE):
            compared = "fewer" if file.is_exceeded else "more"
            raise InputError(
                f"{path} holds {compared} packed points than the {promise.n_points} that its header promises; it is "
                "damaged: copy it again"
            )
    return las
