"""LAS and LAZ files, as surveyors write them, one sweep each, in the sensor's frame.

What unpacks LAZ (lazrs) calls itself without end on some damaged files, which no process survives: another one does it.
"""

import io
import struct
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST
from automos.readers.apart import read_apart
from automos.readers.columns import Columns
from automos.readers.foreign import limited
from automos.readers.formats import import_extra

_HEADER, _VLR, _EVLR = 227, 54, 60
"""Bytes of the shortest header and of the headers of variable and of extended variable length records."""
_FORM, _PACKED = 104, 0xC0
"""The byte with the format of points, and its bits for compressed ones."""
_COARSEST = 1e3
"""Metres that coordinates are counted in, less than which any sensor's are."""
_MOST_PACKED = 10_000
"""By how much LAZ may pack points, at most: more is a damaged count."""
_LASZIP, _OF_ANY_SIZE = (b"laszip encoded", 22204), 0xFFFFFFFF
"""The record of how points are packed, and what it says where chunks differ in size."""


def is_packed(path: Path) -> bool:
    """Return whether the points of a LAS file are packed, whatever its name says; OSError where it cannot be read."""
    with path.open("rb") as file:
        head = file.read(_HEADER)
    return len(head) == _HEADER and head[_FORM] & _PACKED != 0


class Promise(NamedTuple):
    """What a file's header promises, which its size allows.

    Attributes
    ----------
    n_points : points.
    n_before : of them, those in packed chunks before the last one.
    packed : bytes from which and up to which packed points lie, of which nothing gives their number but that they are
        all needed for them; none where that is known.
    """

    n_points: int
    n_before: int = 0
    packed: tuple[int, int] | None = None


def require_whole(path: Path) -> Promise:
    """Return what the header of a LAS or LAZ file promises.

    Raises
    ------
    InputError
        The file is none, or does not hold what its header promises; OSError where it cannot be read.
    """
    with path.open("rb") as file:
        return _promise_of(file, path, path.stat().st_size)


def _promise_of(file: IO[bytes], path: Path, size: int) -> Promise:
    head = file.read(375)
    if len(head) < _HEADER or head[:4] != b"LASF":
        raise InputError(f"{path} is not an LAS file: it does not begin as one")
    header_size, start, n_records, form, width, n_points = struct.unpack_from("<HIIBHI", head, 94)
    n_extended = extended = 0
    if head[25] >= 4 and len(head) >= 375:
        extended, n_extended, n_points = struct.unpack_from("<QIQ", head, 235)
    scales, offsets = np.frombuffer(head, "<f8", 6, 131).reshape(2, 3)
    packed = size - start
    packs = form & _PACKED != 0
    n_chunks, table = _table_of_chunks(file, start, size) if packs and start + 8 <= size else (0, size)
    in_first, in_layers = _first_layers(file, start, form & 0x3F, width) if packs else (None, 0)
    in_chunk = _chunk_size(file, header_size, n_records) if n_chunks else 0
    few = (n_chunks - 1) * in_chunk
    needs = 0 if packs else n_points * width
    left = (extended if n_extended else size) - start - needs
    faults = {
        f"{n_records} records before its points": header_size + n_records * _VLR > start,
        f"points from byte {start}": not _HEADER <= header_size <= start <= size,
        "a table of its packed points that is not there": n_chunks > max(packed, 0),
        "more packed bytes than it holds": in_layers > max(packed, 0),
        f"{n_points} points": left < 0 or (packs and n_points * width > _MOST_PACKED * max(packed, 0)),
        f"{n_points} points, but its first chunk of {in_first}": n_chunks == 1 and in_first not in (None, n_points),
        f"{n_points} points in {n_chunks} chunks of {in_chunk}": in_chunk > 0 and not few <= n_points <= few + in_chunk,
        f"no more than {n_points} points": not packs and left > 0 and head[6] & 6 == 0,
        f"{n_extended} records behind its points": n_extended > 0 and _behind(file, extended, n_extended, size) != size,
        f"points of {width} bytes": width == 0,
        f"a unit of {scales} m": not ((scales > 0.0) & (scales < _COARSEST)).all(),
        f"an origin at {offsets} m": not (np.abs(offsets) < FARTHEST).all(),
    }
    fault = next((what for what, is_so in faults.items() if is_so), None)
    if fault is not None:
        raise InputError(
            f"{path} is cut short or damaged: its header announces {fault}, in {size} bytes; copy it again"
        )
    is_counted = in_first is not None or in_chunk == 0
    return Promise(int(n_points), max(few, 0), None if is_counted else (start + 8, table))


def _behind(file: IO[bytes], at: int, n_records: int, size: int) -> int:
    """Return the byte behind the extended records from byte `at` on, -1 where they do not end in the file."""
    for _ in range(n_records):
        at += _EVLR + int.from_bytes(_at(file, at, _EVLR)[20:28], "little")
        if at > size:
            return -1
    return at


def _at(file: IO[bytes], at: int, n_bytes: int) -> bytes:
    file.seek(at)
    return file.read(n_bytes)


def _first_layers(file: IO[bytes], start: int, form: int, width: int) -> tuple[int | None, int]:
    """Return how many points and bytes the first chunk of a LAZ file announces; None and 0 if it announces neither.

    It does where its points are packed in layers (form 6 on). The library takes memory for them before it reads.
    """
    plain, n_layers = {6: (30, 9), 7: (36, 10), 8: (38, 11)}.get(form, (0, 0))
    if not plain or width < plain:
        return None, 0
    raw = _at(file, start + 8 + width, 4 * (1 + n_layers + width - plain))  # behind the table's place, the first point
    count, *sizes = np.frombuffer(raw[: len(raw) // 4 * 4], "<u4").tolist() or [None]
    return count, sum(sizes)


def _chunk_size(file: IO[bytes], at: int, n_records: int) -> int:
    """Return how many points all chunks of a LAZ file but its last have; 0 where that differs, or is not stored.

    That is in one of the records from byte `at` on.
    """
    for _ in range(n_records):
        if len(head := _at(file, at, _VLR)) < _VLR:
            break
        user, number, length = struct.unpack_from("<16sHH", head, 2)
        if (user.rstrip(b"\0"), number) == _LASZIP:
            (n_points,) = struct.unpack_from("<I", file.read(length).ljust(16, b"\0"), 12)
            return 0 if n_points == _OF_ANY_SIZE else int(n_points)
        at += _VLR + length
    return 0


def _table_of_chunks(file: IO[bytes], start: int, size: int) -> tuple[int, int]:
    """Return of how many chunks the table of a LAZ file announces, and at which byte it is.

    More chunks than there are bytes, where it has no table.
    """
    (table,) = struct.unpack("<q", _at(file, start, 8))
    if table == -1:  # written before it was known; it is said at the end
        (table,) = struct.unpack("<q", _at(file, size - 8, 8))
    if not start + 8 <= table <= size - 8:
        return size + 1, size
    _, n_chunks = struct.unpack("<II", _at(file, table, 8))
    return int(n_chunks), int(table)


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
    try:
        promise = require_whole(path)
        with limited(path):
            las = laspy.read(path) if promise.packed is None else _unpack(path, promise)
    except (OSError, InputError):
        raise
    except Exception as error:  # damaged files break the library in many ways
        raise InputError(f"{path} is not a complete LAS file ({error}); copy it again") from error
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
