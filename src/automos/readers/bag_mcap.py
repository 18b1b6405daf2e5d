"""MCAP files of any profile, walked from record to record: with or without index and summary, or cut at their end."""

import os
import struct
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from automos.readers.bag_chunks import Chunk, ChunkedFile, exactly
from automos.readers.bag_file import Topic, type_name
from automos.readers.formats import import_extra

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX = range(2, 8)
_MAGIC, _RECORD, _MESSAGE_HEAD, _CHUNK_HEAD = 8, 9, 22, 32
"""Bytes before the first record, and before what a record, a message and a chunk hold."""


class McapFile(ChunkedFile):
    """An .mcap."""

    def __init__(self, path: Path):
        """Walk the file; errors are those of `BagFile`."""
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
            elif op == _MESSAGE and with_messages:
                number, _, recorded = struct.unpack("<HIQ", exactly(stream, 14))
                self._add(number, recorded, chunk, at)
            elif op == _CHUNK and with_messages:
                after = self._walk_chunk(stream, at)
            stream.seek(after)

    def _chunk(self, file: BinaryIO, at: int) -> Chunk:
        file.seek(at)
        _, n_record, _, _, size, _, length = struct.unpack("<BQQQQII", exactly(file, _RECORD + _CHUNK_HEAD))
        kind = exactly(file, length).decode()
        (n,) = struct.unpack("<Q", exactly(file, 8))
        return Chunk(file.tell(), n, kind, size, at + _RECORD + n_record)

    def _index(self, file: BinaryIO) -> tuple[int, npt.NDArray[np.int64], npt.NDArray[np.int64]] | None:
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


def _stream(file: BinaryIO, n: int) -> Any:
    """Return the content of a record, which comes next, as the library reads it."""
    return import_extra("mcap.data_stream", "ros").ReadDataStream(BytesIO(exactly(file, n)))
