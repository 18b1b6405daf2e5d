"""MCAP files of any profile, walked from record to record: with or without index and summary, or cut at their end."""

import struct
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from automos.readers.bag_file import IN_FILE, LARGEST, BagFile, Topic, exactly, type_name
from automos.readers.formats import import_extra

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX = range(2, 8)
_MAGIC, _RECORD, _MESSAGE_HEAD, _CHUNK_HEAD = 8, 9, 22, 32
"""Bytes before the first record, and before what a record, a message and a chunk hold."""


class McapFile(BagFile):
    """An .mcap."""

    def __init__(self, path: Path):
        """Walk the file; errors are those of `BagFile`."""
        super().__init__(path)
        self._schemas: dict[int, tuple[str, str]] = {}
        self._channels: dict[int, tuple[int, str, str]] = {}
        self._has_end = False
        first: dict[int, int] = {}
        with open(path, "rb") as file:
            file.seek(_MAGIC)
            try:
                self._walk(file, self.size, IN_FILE, first)
                if not self._has_end:
                    raise EOFError
            except (EOFError, struct.error):
                self.fault = f"{path} ends within a record (byte {self.size}): what is whole before it is read."
            for number in set(self._places) - set(self._channels):  # named in the chunk of their first message alone
                self._walk_within(file, first[number], None)
        for number, (schema, topic, encoding) in self._channels.items():
            kind, of_schema = self._schemas.get(schema, ("", ""))
            encoding = encoding or {"ros1msg": "ros1", "jsonschema": "json"}.get(of_schema, of_schema) or "cdr"
            self.topics[number] = Topic(topic, type_name(kind), "cdr" if encoding.startswith("ros2") else encoding)

    def _walk(self, stream: BinaryIO, end: int, chunk: int, first: dict[int, int] | None) -> None:
        """Take the topics and messages among the records to `end`, of the file or of a chunk.

        `first` is given the chunk of the first message of each topic; None where messages are known, and topics are
        looked for.
        """
        records = import_extra("mcap.records", "ros")
        while (at := stream.tell()) < end:
            op, n = struct.unpack("<BQ", exactly(stream, _RECORD))
            after = stream.tell() + n
            if op == _FOOTER:
                self._has_end = True
                return
            if (after > end and op != _CHUNK) or op == 0:
                raise EOFError
            if op == _SCHEMA:
                schema = records.Schema.read(_stream(stream, n))
                self._schemas[schema.id] = schema.name, schema.encoding
            elif op == _CHANNEL:
                channel = records.Channel.read(_stream(stream, n))
                self._channels[channel.id] = channel.schema_id, channel.topic, channel.message_encoding
            elif op == _MESSAGE and first is not None:
                number, _, recorded = struct.unpack("<HIQ", exactly(stream, 14))
                self._add(number, recorded, chunk, at)
                first.setdefault(number, chunk)
            elif op == _CHUNK and first is not None:
                after = self._walk_chunk(stream, at, after, first)
            stream.seek(after)

    def _walk_chunk(self, file: BinaryIO, at: int, after: int, first: dict[int, int]) -> int:
        """Take the messages in the chunk from byte `at` to `after`; return where its index ends."""
        kind, start, _, _ = _chunk_head(file, at)
        is_indexed = False
        while True:
            file.seek(after)
            head = file.read(_RECORD + 6)
            if len(head) < _RECORD + 6 or head[0] != _INDEX:
                break
            _, n, number, length = struct.unpack("<BQHI", head)
            rows = np.frombuffer(exactly(file, length), "<i8").reshape(-1, 2)
            places = np.empty((len(rows), 3), np.int64)
            places[:, 0] = rows[:, 0]
            places[:, 1], places[:, 2] = (at, rows[:, 1]) if kind else (IN_FILE, start + rows[:, 1])
            if len(rows):
                self._places[number] += places.tobytes()
                first.setdefault(number, at)
            is_indexed, after = True, after + _RECORD + n
        if not is_indexed:
            self._walk_within(file, at, first)
        return after

    def _walk_within(self, file: BinaryIO, chunk: int, first: dict[int, int] | None) -> None:
        kind, start, _, size = _chunk_head(file, chunk)
        if kind:
            unpacked = self._unpack(chunk, size)
            self._walk(BytesIO(unpacked), len(unpacked), chunk, first)
            is_whole = len(unpacked) == size
        else:
            file.seek(start)
            self._walk(file, min(start + size, self.size), IN_FILE, first)
            is_whole = start + size <= self.size
        if not is_whole:
            raise EOFError

    def _packed(self, file: BinaryIO, chunk: int) -> tuple[str, bytes, int]:
        kind, _, n, size = _chunk_head(file, chunk)
        return kind, file.read(min(n, LARGEST)), size

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message whose record begins at a place."""
        return self._bytes(chunk, place + _RECORD + _MESSAGE_HEAD, min(self.size_of(chunk, place), most))

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message has whose record begins at a place."""
        _, n = struct.unpack("<BQ", self._bytes(chunk, place, _RECORD))
        return max(n - _MESSAGE_HEAD, 0)


def _stream(file: BinaryIO, n: int) -> Any:
    """Return the content of a record, which comes next, as the library reads it."""
    return import_extra("mcap.data_stream", "ros").ReadDataStream(BytesIO(exactly(file, n)))


def _chunk_head(file: BinaryIO, at: int) -> tuple[str, int, int, int]:
    """Return of the chunk at byte `at` how it is compressed, where its data begin, their bytes, and those unpacked."""
    file.seek(at + _RECORD)
    _, _, size, _, length = struct.unpack("<QQQII", exactly(file, _CHUNK_HEAD))
    kind = exactly(file, length).decode()
    (n,) = struct.unpack("<Q", exactly(file, 8))
    return kind, file.tell(), n, size
