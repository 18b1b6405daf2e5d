"""Bags of ROS 1 (version 2.0), walked from record to record: whole ones, and those a recorder left without an index."""

import struct
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.readers.bag_file import IN_FILE, LARGEST, BagFile, Topic, exactly, type_name

_VERSION = b"#ROSBAG V2.0\n"
_MESSAGE, _INDEX, _CHUNK, _CONNECTION = b"\x02", b"\x04", b"\x05", b"\x07"


class Ros1File(BagFile):
    """A .bag, or the .bag.active of a recorder that did not end.

    Attributes
    ----------
    connections : what the file says of each topic, by the topic's number: type, md5sum, message_definition and more.
    """

    def __init__(self, path: Path):
        """Walk the file; errors are those of `BagFile`."""
        super().__init__(path)
        self.connections: dict[int, dict[bytes, bytes]] = {}
        with open(path, "rb") as file:
            if (start := file.readline(64)) != _VERSION:
                raise InputError(f"{path} begins with {start!r}, but only {_VERSION!r} is read; convert it: rosbag fix")
            first: dict[int, tuple[int, int, int]] = {}
            try:
                self._walk(file, self.size, IN_FILE, first)
            except (EOFError, struct.error):
                self.fault = f"{path} ends within a record (byte {self.size}): what is whole before it is read."
            for number in set(self._places) - set(self.topics):  # named in the chunk of their first message alone
                self._walk_within(file, *first[number], None)

    def _walk(self, stream: BinaryIO, end: int, chunk: int, first: dict[int, tuple[int, int, int]] | None) -> None:
        """Take the topics and messages among the records to `end`, of the file or of a chunk.

        `first` is given the chunk (its byte, that of its data, their number) of the first message of each topic; None
        where messages are known, and topics are looked for.
        """
        while (at := stream.tell()) < end:
            head = _fields(exactly(stream, _u32(exactly(stream, 4))))
            n, op = _u32(exactly(stream, 4)), head.get(b"op")
            after = stream.tell() + n
            if op == _CONNECTION:
                number, said = _u32(head[b"conn"]), _fields(exactly(stream, n))
                self.connections[number] = said
                self.topics[number] = Topic(head[b"topic"].decode(), type_name(said[b"type"].decode()), "ros1")
            elif op == _CHUNK and n:  # the size of one that its recorder did not finish is 0, and its records follow
                after = self._walk_chunk(stream, at, n, {} if first is None else first)
            elif after > end or op is None:
                raise EOFError
            elif op == _MESSAGE and first is not None:
                self._add(_u32(head[b"conn"]), _nanoseconds(*struct.unpack("<II", head[b"time"])), chunk, at)
            stream.seek(after)

    def _walk_chunk(self, file: BinaryIO, at: int, n: int, first: dict[int, tuple[int, int, int]]) -> int:
        """Take the messages in a chunk whose data, `n` bytes, come next; return where its index ends."""
        start, after = file.tell(), file.tell() + n
        is_plain, is_indexed = _kind(file, at)[0] == "none", False
        file.seek(after)
        while (entries := _index_here(file)) is not None:
            number, rows = entries
            places = np.empty((len(rows), 3), np.int64)
            places[:, 0] = _nanoseconds(rows[:, 0], rows[:, 1])
            places[:, 1], places[:, 2] = (IN_FILE, start + rows[:, 2]) if is_plain else (at, rows[:, 2])
            self._places[number] += places.tobytes()
            first.setdefault(number, (at, start, n))
            is_indexed, after = True, file.tell()
        if not is_indexed:
            self._walk_within(file, at, start, n, first)
        return after

    def _walk_within(
        self, file: BinaryIO, at: int, start: int, n: int, first: dict[int, tuple[int, int, int]] | None
    ) -> None:
        kind, size = _kind(file, at)
        if kind == "none":
            file.seek(start)
            self._walk(file, min(start + n, self.size), IN_FILE, first)
            is_whole = start + n <= self.size
        else:
            unpacked = self._unpack(at, size)
            self._walk(BytesIO(unpacked), len(unpacked), at, first)
            is_whole = len(unpacked) == size
        if not is_whole:
            raise EOFError

    def _packed(self, file: BinaryIO, chunk: int) -> tuple[str, bytes, int]:
        kind, size = _kind(file, chunk)
        return kind, file.read(_u32(exactly(file, 4))), size

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message whose record begins at a place."""
        at, n = self._content(chunk, place)
        return self._bytes(chunk, at, min(n, most))

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message has whose record begins at a place."""
        return self._content(chunk, place)[1]

    def _content(self, chunk: int, place: int) -> tuple[int, int]:
        at = place + 4 + _u32(self._bytes(chunk, place, 4))
        return at + 4, _u32(self._bytes(chunk, at, 4))


def _u32(raw: bytes) -> int:
    return int(struct.unpack("<I", raw)[0])


def _nanoseconds(seconds: Any, nanoseconds: Any) -> Any:
    return 10**9 * seconds + nanoseconds


def _fields(raw: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header by name."""
    fields, at = {}, 0
    while at < len(raw):
        end = at + 4 + _u32(raw[at : at + 4])
        name, _, value = raw[at + 4 : end].partition(b"=")
        fields[name], at = value, end
    return fields


def _kind(file: BinaryIO, at: int) -> tuple[str, int]:
    """Return how the chunk that begins at byte `at` is compressed, and how many bytes it unpacks to."""
    file.seek(at)
    head = _fields(exactly(file, _u32(exactly(file, 4))))
    return head[b"compression"].decode(), _u32(head[b"size"])


def _index_here(file: BinaryIO) -> tuple[int, npt.NDArray[np.int64]] | None:
    """Return the topic and rows (seconds, nanoseconds, place) of the index that comes next, None where none does."""
    try:
        head = _fields(exactly(file, _u32(exactly(file, 4))))
        if head.get(b"op") != _INDEX:
            return None
        rows = np.frombuffer(exactly(file, _u32(exactly(file, 4))), "<u4")
    except (EOFError, struct.error):
        return None
    return _u32(head[b"conn"]), rows.reshape(-1, 3).astype(np.int64)
