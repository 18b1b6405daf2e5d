"""One file of a bag: which topics it holds, where their messages lie, and the bytes of one.

A file is walked from record to record, past the points: no index at its end is needed, so what a recorder that was
killed left behind is read, too, and a chunk that an index lists twice is there once.
"""

import importlib
from collections import defaultdict
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError

LARGEST = 1 << 30
"""Bytes of a message, or of the chunk it is in, at most; the clouds of any sensor have a hundredth of that."""
_AHEAD = 1 << 13
"""Bytes that are unpacked beyond what is asked for at first: a message's header is read in pieces."""
IN_FILE = -1
"""The chunk of what is not compressed: its places count from the start of the file."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""What begins with it is compressed."""


class Topic(NamedTuple):
    """A topic's name, the type of its messages (sensor_msgs/msg/PointCloud2), and how they are packed (cdr, ros1)."""

    name: str
    kind: str
    encoding: str


class BagFile:
    """The topics and messages of one file; each kind of file derives from it and says how it is walked."""

    def __init__(self, path: Path):
        """Walk the file.

        Raises
        ------
        InputError
            It is of a version that is not read; other exceptions where it is damaged.
        """
        self.path, self.size = path, path.stat().st_size
        self.topics: dict[int, Topic] = {}
        self.fault = ""
        self._places: defaultdict[int, bytearray] = defaultdict(bytearray)
        self._unpacked: tuple[int, bytes] = (IN_FILE, b"")

    def places(self, number: int) -> npt.NDArray[np.int64]:
        """Return (N, 3) when each message of topic `number` was recorded (ns), its chunk, and where it begins there."""
        return np.frombuffer(bytes(self._places[number]), np.int64).reshape(-1, 3)

    def keep(self, numbers: set[int]) -> None:
        """Forget the messages of all other topics, of which there may be millions."""
        self._places = defaultdict(bytearray, {n: rows for n, rows in self._places.items() if n in numbers})

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message at a place."""
        raise NotImplementedError

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message at a place has."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_unpacked": (IN_FILE, b"")}

    # ------------------------------------------------------------------------------ for those that are made of chunks
    def _add(self, number: int, recorded: int, chunk: int, place: int) -> None:
        self._places[number] += np.array([recorded, chunk, place], np.int64).tobytes()

    def _bytes(self, chunk: int, place: int, n: int) -> bytes:
        """Return `n` bytes from a place on, of the file or of what a chunk of it unpacks to.

        Raises
        ------
        InputError
            There are fewer, or more than `LARGEST`.
        """
        if n > LARGEST or (chunk != IN_FILE and place + n > LARGEST):
            raise InputError(
                f"{self.path} holds a message of {n} bytes at byte {place}, more than any sensor's cloud has "
                f"({LARGEST} at most); check what was recorded"
            )
        if chunk == IN_FILE:
            with open(self.path, "rb") as file:
                file.seek(place)
                found = file.read(n)
        else:
            found = self._unpack(chunk, place + n)[place : place + n]
        if len(found) < n:
            raise EOFError(f"it ends within the message at byte {place}")
        return found

    def _unpack(self, chunk: int, n: int) -> bytes:
        """Return at least the first `n` bytes of a chunk, or all; all of it once more is asked for than at first."""
        at, known = self._unpacked
        if at == chunk and len(known) >= n:
            return known
        with open(self.path, "rb") as file:
            kind, packed, size = self._packed(file, chunk)
        if size > LARGEST:
            raise InputError(
                f"{self.path} holds a chunk that {len(packed)} bytes at byte {chunk} unpack to {size} bytes, more than "
                f"is read at once ({LARGEST}); write it anew in smaller chunks: mcap filter, rosbag filter"
            )
        known = unpack(packed, kind, size if at == chunk else min(size, n + _AHEAD))
        self._unpacked = chunk, known
        return known

    def _packed(self, file: BinaryIO, chunk: int) -> tuple[str, bytes, int]:
        """Return how the chunk that begins at byte `chunk` is compressed, its bytes, and how many these unpack to."""
        raise NotImplementedError


def unpack(packed: bytes, kind: str, n: int) -> bytes:
    """Return the first `n` bytes that `packed` unpacks to, or all if it has fewer; no more are ever in memory."""
    import bz2

    if kind in ("", "none"):
        return packed[:n]
    if kind == "bz2":
        return bz2.BZ2Decompressor().decompress(packed, n)
    if kind == "lz4":
        return bytes(importlib.import_module("lz4.frame").LZ4FrameDecompressor().decompress(packed, n))
    if kind == "zstd":
        with (
            importlib.import_module("zstandard")
            .ZstdDecompressor()
            .stream_reader(packed, read_across_frames=True) as reader
        ):
            return bytes(reader.read(n))
    raise ValueError(f"compression {kind!r} is not known")


def type_name(name: str) -> str:
    """Return the name of a message type as ROS 2 writes it: ROS 1 says sensor_msgs/PointCloud2."""
    package, _, kind = name.rpartition("/")
    return f"{package}/msg/{kind}" if package and not package.endswith("/msg") else name


def exactly(stream: BinaryIO, n: int) -> bytes:
    """Return the next `n` bytes; EOFError where there are fewer."""
    found = stream.read(n) if n <= LARGEST else b""
    if len(found) < n:
        raise EOFError
    return found
