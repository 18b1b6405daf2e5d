"""Livox's own recordings, .lvx of its first sensors and .lvx2: packets, in frames that say where the next begins."""

import struct
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.readers.packets.pcap import Datagrams

SUFFIXES = (".lvx", ".lvx2")
_SIGNATURE, _HEADER, _FRAME = b"livox_tech", 29, 24
"""What such a file begins with, the bytes before the sensors in it are described, and those of a frame's header."""
_FIRST = {0: 1300, 1: 900, 2: 1344, 3: 960, 4: 1344, 5: 768, 6: 24, 7: 1260, 8: 660}
"""Bytes of points (or, 6, of the inertial unit) in a package of each data type of the first protocol."""
_PIECE = 4096
"""Packages that are looked at together."""


class LvxFile:
    """A file of `size` bytes; its packages are read as the datagrams of a capture are."""

    def __init__(self, path: Path):
        """Read its header.

        Raises
        ------
        InputError
            Not such a file, or of a version that is not read.
        """
        self.path, self.size = path, path.stat().st_size
        with open(path, "rb") as file:
            head = file.read(_HEADER)
        if len(head) < _HEADER or not head.startswith(_SIGNATURE) or (head[16], head[17]) not in ((1, 1), (2, 0)):
            raise InputError(f"{path} is no recording of Livox's viewer of version 1.1 or 2.0; record or copy it again")
        self.is_second = head[16] == 2
        self._start = _HEADER + head[28] * (63 if self.is_second else 59)

    def datagrams(self, n_bytes: int, start: int = 0, stop: int | None = None) -> Iterator[Datagrams]:
        """Yield, piece by piece, the packages of `n_bytes` that begin from byte `start` of the file to `stop`.

        Raises
        ------
        InputError
            The file ends within a package, or a frame holds something else.
        """
        data = np.memmap(self.path, np.uint8, "r")
        stop = self.size if stop is None else min(stop, self.size)
        packages = self._packages(memoryview(data.data), n_bytes, start, stop)
        while found := list(islice(packages, _PIECE)):
            records, seconds, senders = map(np.array, zip(*found, strict=True))
            yield Datagrams(records, np.stack([data[at : at + n_bytes] for at in records]), seconds, senders)

    def _packages(self, raw: memoryview, n_bytes: int, start: int, stop: int) -> Iterator[tuple[int, float, int]]:
        """Yield of each such package where it begins, when it was measured, s, and which sensor sent it."""
        head, kind_at, nano_at = (27, 17, 7) if self.is_second else (19, 10, 11)
        for begin, end in self._frames(raw, stop):
            at = max(begin, start)
            while at < min(end, stop):
                kind = raw[at + kind_at]
                length = struct.unpack_from("<I", raw, at + 18)[0] if self.is_second else _FIRST.get(kind, 0)
                if length == 0 or at + head + length > min(end, self.size):
                    raise self._damage(at)
                if head + length == n_bytes:
                    sensor = struct.unpack_from("<I", raw, at + 1)[0] if self.is_second else raw[at]
                    yield at, 1e-9 * struct.unpack_from("<Q", raw, at + nano_at)[0], sensor << 16
                at += head + length

    def _frames(self, raw: memoryview, stop: int) -> Iterator[tuple[int, int]]:
        """Yield where the packages of each frame before byte `stop` begin and end."""
        begin = self._start
        while begin < stop:
            if begin + _FRAME > self.size:
                raise self._damage(begin)
            here, end = struct.unpack_from("<QQ", raw, begin)
            end = end or self.size
            if here != begin or end < begin + _FRAME:
                raise self._damage(begin)
            yield begin + _FRAME, end
            begin = end

    def _damage(self, at: int) -> InputError:
        return InputError(f"{self.path} is cut or damaged at byte {at} of {self.size}; copy it again")
