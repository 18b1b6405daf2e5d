"""Bags of ROS 1 (version 2.0), walked from record to record: whole ones, and those a recorder left without an index."""

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.readers.bag_chunks import Chunk, ChunkedFile, exactly
from automos.readers.bag_file import Topic, type_name

_VERSION = b"#ROSBAG V2.0\n"
_MESSAGE, _INDEX, _CHUNK, _CONNECTION = b"\x02", b"\x04", b"\x05", b"\x07"


class Ros1File(ChunkedFile):
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
        self._walk_all(len(_VERSION), self.topics)

    def _walk(self, stream: BinaryIO, end: int, chunk: int, with_messages: bool) -> None:
        while (at := stream.tell()) < end:
            head, n = _record(stream)
            op, after = head.get(b"op"), stream.tell() + n
            if op == _CONNECTION:
                number, said = _u32(head[b"conn"]), _fields(exactly(stream, n))
                self.connections[number] = said
                self.topics[number] = Topic(head[b"topic"].decode(), type_name(said[b"type"].decode()), "ros1")
            elif op == _CHUNK and n:  # the size of one that its recorder did not finish is 0, and its records follow
                after = self._walk_chunk(stream, at)
            elif after > end or op is None:
                raise EOFError
            elif op == _MESSAGE and with_messages:
                self._add(_u32(head[b"conn"]), _nanoseconds(*struct.unpack("<II", head[b"time"])), chunk, at)
            stream.seek(after)

    def _chunk(self, file: BinaryIO, at: int) -> Chunk:
        file.seek(at)
        head, n = _record(file)
        start = file.tell()
        return Chunk(start, n, head[b"compression"].decode(), _u32(head[b"size"]), start + n)

    def _index(self, file: BinaryIO) -> tuple[int, npt.NDArray[np.int64], npt.NDArray[np.int64]] | None:
        try:
            head, n = _record(file)
            if head.get(b"op") != _INDEX:
                return None
            rows = np.frombuffer(exactly(file, n), "<u4").reshape(-1, 3).astype(np.int64)
        except (EOFError, struct.error):
            return None
        return _u32(head[b"conn"]), _nanoseconds(rows[:, 0], rows[:, 1]), rows[:, 2]

    def _content(self, chunk: int, place: int) -> tuple[int, int]:
        at = place + 4 + _u32(self._bytes(chunk, place, 4))
        return at + 4, _u32(self._bytes(chunk, at, 4))


def _u32(raw: bytes) -> int:
    return int(struct.unpack("<I", raw)[0])


def _nanoseconds(seconds: Any, nanoseconds: Any) -> Any:
    return 10**9 * seconds + nanoseconds


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
