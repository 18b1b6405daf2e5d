"""What a LAS file's header promises, compared with the file before a library takes memory or time for it."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from automos.errors import InputError
from automos.pose_files import FARTHEST

_HEADER, _VLR, _EVLR = 227, 54, 60
"""Bytes of the shortest header and of the headers of variable and of extended variable length records."""
_COARSEST = 1e3
"""Metres that coordinates are counted in, less than which any sensor's are."""
_MOST_PACKED = 10_000
"""By how much LAZ may pack points, at most: more is a damaged count."""


def require_whole(path: Path) -> int:
    """Return how many points the header of a LAS or LAZ file promises.

    Raises
    ------
    InputError
        The file is none, or does not hold what its header promises; OSError where it cannot be read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(375)
    if len(head) < _HEADER or head[:4] != b"LASF":
        raise InputError(f"{path} is no LAS file: it does not begin as one")
    header_size, start, n_records, form, width, n_points = struct.unpack_from("<HIIBHI", head, 94)
    n_extended = extended = 0
    if head[25] >= 4 and len(head) >= 375:
        extended, n_extended, n_points = struct.unpack_from("<QIQ", head, 235)
    scales, offsets = np.frombuffer(head, "<f8", 6, 131).reshape(2, 3)
    packed = size - start
    is_packed = form & 0xC0 != 0
    n_chunks = _count_chunks(path, start, size) if is_packed and start + 8 <= size else 0
    in_layers = _first_layers(path, start, form & 0x3F, width) if is_packed else 0
    needs = 0 if is_packed else n_points * width
    left = (extended if n_extended else size) - start - needs
    faults = {
        f"{n_records} records before its points": header_size + n_records * _VLR > start,
        f"points from byte {start}": not _HEADER <= header_size <= start <= size,
        "a table of its packed points that is not there": n_chunks > max(packed, 0),
        "more packed bytes than it holds": in_layers > max(packed, 0),
        f"{n_points} points": left < 0 or (is_packed and n_points * width > _MOST_PACKED * max(packed, 0)),
        f"no more than {n_points} points": not is_packed and width > 0 and left >= width and head[6] & 6 == 0,
        f"{n_extended} records behind its points": n_extended > 0 and extended + n_extended * _EVLR > size,
        f"points of {width} bytes": width == 0,
        f"a unit of {scales} m": not ((scales > 0.0) & (scales < _COARSEST)).all(),
        f"an origin at {offsets} m": not (np.abs(offsets) < FARTHEST).all(),
    }
    fault = next((what for what, is_so in faults.items() if is_so), None)
    if fault is not None:
        raise InputError(f"{path} is cut short or damaged: its header tells of {fault}, in {size} bytes; copy it again")
    return int(n_points)


def _first_layers(path: Path, start: int, form: int, width: int) -> int:
    """Return how many bytes the first chunk of a LAZ file tells of, where its points are packed in layers (form 6 on).

    The library takes memory for them before it reads.
    """
    plain, n_layers = {6: (30, 9), 7: (36, 10), 8: (38, 11)}.get(form, (0, 0))
    if not plain or width < plain:
        return 0
    with path.open("rb") as file:
        file.seek(start + 8 + width + 4)  # the table's place, the first point, how many there are
        raw = file.read(4 * (n_layers + width - plain))
    return sum(np.frombuffer(raw[: len(raw) // 4 * 4], "<u4").tolist())


def _count_chunks(path: Path, start: int, size: int) -> int:
    """Return of how many chunks the table of a LAZ file tells, more than there are bytes where it has none."""
    with path.open("rb") as file:
        file.seek(start)
        (table,) = struct.unpack("<q", file.read(8))
        if table == -1:  # written before it was known; it is said at the end
            file.seek(size - 8)
            (table,) = struct.unpack("<q", file.read(8))
        if not start + 8 <= table <= size - 8:
            return size + 1
        file.seek(table)
        _, n_chunks = struct.unpack("<II", file.read(8))
    return int(n_chunks)
