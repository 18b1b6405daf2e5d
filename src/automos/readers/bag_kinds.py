"""The kinds of files that bags are made of: MCAP, bags of ROS 1 (version 2.0), SQLite of the recorder of ROS 2 (.db3).

The first two are walked from record to record: with or without an index, whole ones, and those that a recorder did not
end.
"""

import os
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np

from automos.core.arrays import Ints
from automos.core.errors import InputError
from automos.readers.bag_chunks import Chunk, ChunkedFile, exactly
from automos.readers.bag_messages import LARGEST, Topic, type_name
from automos.readers.wire import Wire

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX = range(2, 8)
_MAGIC, _RECORD, _MESSAGE_HEAD, _CHUNK_HEAD = 8, 9, 22, 32
"""Bytes before the first record, and before what a record, a message and a chunk hold."""


class McapFile(ChunkedFile):
    """An .mcap."""

    def __init__(self, path: Path):
        """Walk the file; errors are those of `ChunkedFile`."""
        super().__init__(path)
        self._schemas: dict[int, tuple[str, str]] = {}
        self._channels: dict[int, tuple[int, str, str]] = {}
        self._has_end = False
        self._walk_all(_MAGIC, self._channels)
        if not self._has_end:
            self._say_cut()
        for number, (schema, topic, encoding) in self._channels.items():
            kind, of_schema = self._schemas.get(schema, ("", ""))
            encoding = encoding or {"ros1msg": "ros1", "jsonschema": "json"}.get(of_schema, of_schema) or "cdr"
            self.topics[number] = Topic(topic, type_name(kind), "cdr" if encoding.startswith("ros2") else encoding)

    def _walk(self, stream: BinaryIO, end: int, chunk: int, with_messages: bool) -> None:
        while (at := stream.tell()) < end:
            op, n = struct.unpack("<BQ", exactly(stream, _RECORD))
            after = stream.tell() + n
            if op == _FOOTER:
                self._has_end = True
                return
            if (after > end and op != _CHUNK) or op == 0:
                raise EOFError
            if op == _SCHEMA:
                number, name, encoding = _numbers_and_texts("H", exactly(stream, n))
                self._schemas[number] = name, encoding
            elif op == _CHANNEL:
                number, schema, topic, encoding = _numbers_and_texts("HH", exactly(stream, n))
                self._channels[number] = schema, topic, encoding
            elif op == _MESSAGE and with_messages:
                number, _, recorded = struct.unpack("<HIQ", exactly(stream, 14))
                self._add(number, [recorded, chunk, at])
            elif op == _CHUNK and with_messages:
                after = self._walk_chunk(stream, at)
            stream.seek(after)

    def _chunk(self, file: BinaryIO, at: int) -> Chunk:
        file.seek(at)
        _, n_record, _, _, size, _, length = struct.unpack("<BQQQQII", exactly(file, _RECORD + _CHUNK_HEAD))
        kind = exactly(file, length).decode()
        (n,) = struct.unpack("<Q", exactly(file, 8))
        return Chunk(file.tell(), n, kind, size, at + _RECORD + n_record)

    def _index(self, file: BinaryIO) -> tuple[int, Ints, Ints] | None:
        head = file.read(_RECORD + 6)
        if len(head) < _RECORD + 6 or head[0] != _INDEX:
            return None
        _, n, number, length = struct.unpack("<BQHI", head)
        rows = np.frombuffer(exactly(file, length), "<i8").reshape(-1, 2)
        file.seek(n - length - 6, os.SEEK_CUR)
        return number, rows[:, 0], rows[:, 1]

    def _content(self, chunk: int, place: int) -> tuple[int, int]:
        _, n = struct.unpack("<BQ", self._bytes(chunk, place, _RECORD))
        return place + _RECORD + _MESSAGE_HEAD, max(n - _MESSAGE_HEAD, 0)


def _numbers_and_texts(kinds: str, raw: bytes) -> tuple[Any, ...]:
    """Return the numbers, as `struct` calls their kinds, and the two texts that a record of a topic begins with.

    What is counted behind them (a schema's definition, what is told of a channel) must be there, too: ValueError for a
    record that ends within it is no end of the file, after which the rest would count as cut off.
    """
    here = Wire(raw, False, struct.calcsize(f"<{kinds}"))
    try:
        found = *struct.unpack_from(f"<{kinds}", raw), here.text().decode(), here.text().decode()
        here.text()
    except struct.error:
        here.at = len(raw) + 1
    if here.at > len(raw):
        raise ValueError("a record of a topic ends within a text")
    return found


_VERSION = b"#ROSBAG V2.0\n"
_ROS1_MESSAGE, _ROS1_INDEX, _ROS1_CHUNK, _CONNECTION = b"\x02", b"\x04", b"\x05", b"\x07"


class Ros1File(ChunkedFile):
    """A .bag, or the .bag.active of a recorder that did not end.

    Attributes
    ----------
    connections : what the file says of each topic, by the topic's number: type, md5sum, message_definition and more.
    """

    def __init__(self, path: Path):
        """Walk the file; errors are those of `ChunkedFile`."""
        super().__init__(path)
        self.connections: dict[int, dict[bytes, bytes]] = {}
        with open(path, "rb") as file:
            if (start := file.readline(64)) != _VERSION:
                raise InputError(f"{path} begins with {start!r}, but only {_VERSION!r} is read; convert it: rosbag fix")
        self._walk_all(len(_VERSION), self.topics)

    def _walk(self, stream: BinaryIO, end: int, chunk: int, with_messages: bool) -> None:
        while (at := stream.tell()) < end:
            head, n = _record(stream)
            op, after = head.get(b"op"), stream.tell() + n
            if op == _CONNECTION:
                number, said = _u32(head[b"conn"]), _fields(exactly(stream, n))
                self.connections[number] = said
                self.topics[number] = Topic(head[b"topic"].decode(), type_name(said[b"type"].decode()), "ros1")
            elif op == _ROS1_CHUNK and n:  # one that its recorder did not finish has size 0, and its records follow
                after = self._walk_chunk(stream, at)
            elif after > end or op is None:
                raise EOFError
            elif op == _ROS1_MESSAGE and with_messages:
                seconds, nanoseconds = struct.unpack("<II", head[b"time"])
                self._add(_u32(head[b"conn"]), [10**9 * seconds + nanoseconds, chunk, at])
            stream.seek(after)

    def _chunk(self, file: BinaryIO, at: int) -> Chunk:
        file.seek(at)
        head, n = _record(file)
        start = file.tell()
        return Chunk(start, n, head[b"compression"].decode(), _u32(head[b"size"]), start + n)

    def _index(self, file: BinaryIO) -> tuple[int, Ints, Ints] | None:
        try:
            head, n = _record(file)
            if head.get(b"op") != _ROS1_INDEX:
                return None
            rows = np.frombuffer(exactly(file, n), "<u4").reshape(-1, 3).astype(np.int64)
        except (EOFError, struct.error):
            return None
        return _u32(head[b"conn"]), 10**9 * rows[:, 0] + rows[:, 1], rows[:, 2]

    def _content(self, chunk: int, place: int) -> tuple[int, int]:
        at = place + 4 + _u32(self._bytes(chunk, place, 4))
        return at + 4, _u32(self._bytes(chunk, at, 4))


def _u32(raw: bytes) -> int:
    return int(struct.unpack("<I", raw)[0])


def _record(stream: BinaryIO) -> tuple[dict[bytes, bytes], int]:
    """Return the fields of the header of the record that comes next, and the bytes of its data, which follow."""
    head = _fields(exactly(stream, _u32(exactly(stream, 4))))
    return head, _u32(exactly(stream, 4))


def _fields(raw: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header by name."""
    fields, at = {}, 0
    while at < len(raw):
        end = at + 4 + _u32(raw[at : at + 4])
        name, _, value = raw[at + 4 : end].partition(b"=")
        fields[name], at = value, end
    return fields


T = TypeVar("T")


class SqliteFile:
    """A .db3, whose messages lie in no chunk; its attributes are those of `ChunkedFile`."""

    fault = ""

    def __init__(self, path: Path):
        """List the topics; damaged files raise what `automos.core.reading.damage_reported` knows."""
        self.path, self.topics = path, dict[int, Topic]()
        for number, name, kind, encoding in self._rows("SELECT id, name, type, serialization_format FROM topics"):
            self.topics[number] = Topic(name, type_name(kind), encoding)

    def places(self, number: int) -> Ints:
        """Return (N, 3) when each message of topic `number` was recorded (ns), 0, and its number in the file."""
        rows = self._rows("SELECT timestamp, 0, id FROM messages WHERE topic_id = ? ORDER BY timestamp, id", number)
        return np.array(rows, np.int64).reshape(-1, 3)

    def keep(self, numbers: set[int]) -> None:
        """Forget nothing: they are listed when asked for."""

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message of a number."""
        rows = self._rows("SELECT substr(data, 1, ?) FROM messages WHERE id = ?", most, place)
        if not rows:
            raise EOFError(f"it has no message {place} any more")
        return bytes(rows[0][0])

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message of a number has."""
        return int(self._rows("SELECT length(data) FROM messages WHERE id = ?", place)[0][0])

    def _rows(self, query: str, *values: int) -> list[tuple]:
        return self._using(lambda connection: connection.execute(query, values).fetchall())

    def copy_to(self, target: sqlite3.Connection) -> None:
        """Copy the whole database, with what is in its journal alone."""
        self._using(lambda connection: connection.backup(target))

    def _using(self, use: Callable[[sqlite3.Connection], T]) -> T:
        where = self.path.absolute().as_uri()
        try:  # read only, with the journal that a killed recorder left beside it
            return _used(f"{where}?mode=ro", use)
        except sqlite3.OperationalError:  # on a disk that is read only, too
            return _used(f"{where}?immutable=1", use)


def _used(uri: str, use: Callable[[sqlite3.Connection], T]) -> T:
    with closing(sqlite3.connect(uri, uri=True)) as connection:
        connection.execute("PRAGMA trusted_schema = OFF")
        return use(connection)


BagFile = McapFile | Ros1File | SqliteFile
KINDS: dict[bytes, type[BagFile]] = {
    b"#ROSBAG V": Ros1File,
    b"\x89MCAP0\r\n": McapFile,
    b"SQLite format 3\0": SqliteFile,
}
"""What files of each kind begin with, whatever their names, and what reads them."""
