"""What a LAS file's header promises, compared with the file before a library takes memory or time for it."""

import struct
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST

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
