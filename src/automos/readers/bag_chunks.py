"""Files of records and of chunks of further ones: where the messages lie in them, and the bytes of one.

A file is walked from record to record, past the points: no index at its end is needed, so what a recorder that was
killed left behind is read, too, and a chunk that an index lists twice is there once.
"""

import struct
from collections import defaultdict
from collections.abc import Container
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Ints
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.readers.bag_messages import LARGEST, Topic

_AHEAD = 1 << 13
"""Bytes that are unpacked beyond what is asked for at first: a message's header is read in pieces."""
IN_FILE = -1
"""The chunk of what is not compressed: its places count from the start of the file."""
_PLAIN = ("", "none")
"""How formats call what is not compressed."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""What begins with it is compressed."""


class Chunk(NamedTuple):
    """Where a chunk's data begin, their bytes, how they are compressed, what they unpack to, where its record ends."""

    start: int
    n: int
    kind: str
    size: int
    end: int

    @property
    def is_plain(self) -> bool:
        """Whether the data are records as they are."""
        return self.kind in _PLAIN


class ChunkedFile:
    """A file of records, some of which are chunks of further ones; each kind says what its records look like.

    Attributes
    ----------
    topics : by the number that messages have of them.
    fault : where the file was cut off, in a sentence; empty for a whole one.
    """

    def __init__(self, path: Path):
        """Begin with no messages; those that derive from it raise InputError for versions that are not read.

        Damaged files raise what `automos.core.reading.damage_reported` knows.
        """
        self.path, self.topics, self.fault = path, dict[int, Topic](), ""
        self.size = path.stat().st_size
        self._places: defaultdict[int, bytearray] = defaultdict(bytearray)
        self._unpacked: tuple[int, bytes] = (IN_FILE, b"")

    def places(self, number: int) -> Ints:
        """Return (N, 3) when each message of topic `number` was recorded (ns), its chunk, and where it begins there."""
        return np.frombuffer(bytes(self._places[number]), np.int64).reshape(-1, 3)

    def keep(self, numbers: set[int]) -> None:
        """Forget the messages of all other topics, of which there may be millions."""
        self._places = defaultdict(bytearray, {n: rows for n, rows in self._places.items() if n in numbers})

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message whose record begins at a place."""
        at, n = self._content(chunk, place)
        return self._bytes(chunk, at, min(n, most))

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message has whose record begins at a place."""
        return self._content(chunk, place)[1]

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_unpacked": (IN_FILE, b"")}

    # ------------------------------------------------------------------------------------ what each kind of file says
    def _walk(self, stream: BinaryIO, end: int, chunk: int, with_messages: bool) -> None:
        """Take the topics, and the messages if they are not known yet, among the records to `end`.

        stream : the file, or what the chunk at byte `chunk` unpacks to.
        """
        raise NotImplementedError

    def _chunk(self, file: BinaryIO, at: int) -> Chunk:
        """Return what the chunk is whose record begins at byte `at`."""
        raise NotImplementedError

    def _index(self, file: BinaryIO) -> tuple[int, Ints, Ints] | None:
        """Return topic, times (ns) and places in the chunk of the messages that the next record lists, if it does."""
        raise NotImplementedError

    def _content(self, chunk: int, place: int) -> tuple[int, int]:
        """Return where the message begins whose record begins at a place, and its bytes."""
        raise NotImplementedError

    # ---------------------------------------------------------------------------------------------------- what is alike
    def _walk_all(self, start: int, named: Container[int]) -> None:
        """Take all records from byte `start` on; `named` comes to hold the topics that records of their own name."""
        self._first: dict[int, int] = {}  # the chunk of the first message of each topic
        with open(self.path, "rb") as file:
            file.seek(start)
            try:
                self._walk(file, self.size, IN_FILE, True)
            except (EOFError, struct.error):
                self._say_cut()
            for number in self._places:
                if number not in named:  # but in the chunk of its first message alone
                    self._walk_within(file, self._first[number], False)

    def _say_cut(self) -> None:
        self.fault = f"{self.path} ends within a record (byte {self.size}): what is whole before it is read."

    def _add(self, number: int, rows: npt.ArrayLike) -> None:
        """Take messages of topic `number`: (N, 3) or (3,) when each was recorded, its chunk and its place there."""
        self._places[number] += np.asarray(rows, np.int64).tobytes()

    def _walk_chunk(self, file: BinaryIO, at: int) -> int:
        """Take the messages in the chunk at byte `at`, by its index where it has one; return where that ends."""
        chunk, is_indexed = self._chunk(file, at), False
        after = chunk.end
        file.seek(after)
        while (listed := self._index(file)) is not None:
            number, recorded, places = listed
            if len(places):
                where = (IN_FILE, chunk.start + places) if chunk.is_plain else (at, places)
                self._add(number, np.column_stack(np.broadcast_arrays(recorded, *where)))
                self._first.setdefault(number, at)
            is_indexed, after = True, file.tell()
        if not is_indexed:
            self._walk_within(file, at, True)
        return after

    def _walk_within(self, file: BinaryIO, at: int, with_messages: bool) -> None:
        chunk = self._chunk(file, at)
        if chunk.is_plain:
            end = chunk.start + chunk.n
            file.seek(chunk.start)
            self._walk(file, min(end, self.size), IN_FILE, with_messages)
            is_whole = end <= self.size
        else:
            unpacked = self._unpack(at, chunk.size)
            self._walk(BytesIO(unpacked), len(unpacked), at, with_messages)
            is_whole = len(unpacked) == chunk.size
        if not is_whole:
            raise EOFError

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
            start, n_packed, kind, size, _ = self._chunk(file, chunk)
            file.seek(start)
            packed = file.read(min(n_packed, LARGEST))
        if size > LARGEST:
            raise InputError(
                f"{self.path} holds a chunk that {len(packed)} bytes at byte {chunk} unpack to {size} bytes, more than "
                f"is read at once ({LARGEST}); write it anew in smaller chunks: mcap filter, rosbag filter"
            )
        known = unpack(packed, kind, size if at == chunk else min(size, n + _AHEAD))
        self._unpacked = chunk, known
        return known


def unpack(packed: bytes, kind: str, n: int) -> bytes:
    """Return the first `n` bytes that `packed` unpacks to, or all if it has fewer; no more are ever in memory."""
    import bz2

    if kind in _PLAIN:
        return packed[:n]
    if kind == "bz2":
        return bz2.BZ2Decompressor().decompress(packed, n)
    if kind == "lz4":
        return bytes(import_extra("lz4.frame", "ros").LZ4FrameDecompressor().decompress(packed, n))
    if kind == "zstd":
        zstd = import_extra("zstandard", "ros").ZstdDecompressor()
        with zstd.stream_reader(packed, read_across_frames=True) as reader:
            return bytes(reader.read(n))
    raise ValueError(f"compression {kind!r} is not known")


def exactly(stream: BinaryIO, n: int) -> bytes:
    """Return the next `n` bytes; EOFError where there are fewer."""
    found = stream.read(n) if n <= LARGEST else b""
    if len(found) < n:
        raise EOFError
    return found
