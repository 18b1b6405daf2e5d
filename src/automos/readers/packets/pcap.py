"""Captures of network traffic (libpcap's classic files, and pcapng): the UDP datagrams of one size in a part of one.

Records can be read from any record on, a piece of the file in memory at a time, so the part before need not be read
again. Libraries for captures read from the start and do not report positions.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from ipaddress import IPv4Address
from pathlib import Path

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from automos.core.arrays import Array, Ints
from automos.core.column_data import ColumnData
from automos.core.errors import InputError
from automos.core.kernels import kernel
from automos.core.reading import damage_reported

_MAGIC = {0xA1B2C3D4: 1e-6, 0xA1B23C4D: 1e-9}
"""First four bytes, and the seconds that a fraction counts."""
_PCAPNG, _NG_BIG = b"\n\r\r\n", bytes.fromhex("1A2B3C4D")
"""What a capture of the newer kind begins with, and its ninth to twelfth byte where the first of a number is high."""
_INTERFACE, _OLD_PACKET, _PACKET = 1, 2, 6
"""Types of its blocks."""
_HEADER, _RECORD = 24, 16
_PIECE = 1 << 24
"""Bytes read at once; the longest record has a quarter of a million."""
_ANY, _NO_SIZE = 0, 1 << 16
"""In place of the bytes of a datagram: of any size, and what none has."""
_LINKS = {0: 4, 1: 14, 101: 0, 108: 4, 113: 16, 228: 0, 276: 20}
"""Bytes before the IP header by type of link: loopback, Ethernet, raw IP, Linux's cooked captures."""


@dataclass(frozen=True, eq=False)
class Datagrams(ColumnData):
    """Datagrams in the order of their records.

    Attributes
    ----------
    records : (N,) int64, byte of the file at which each one's record begins.
    payloads : (N, size) uint8, what was sent.
    seconds : (N,) float64, when it was recorded.
    senders : (N,) int64, the sender's IPv4 address and, in the lowest 16 bits, the port it sent to.
    """

    records: Ints
    payloads: npt.NDArray[np.uint8]
    seconds: Array
    senders: Ints


@dataclass(frozen=True)
class Capture:
    """A file of `size` bytes, whether it is a pcapng, its byte order, and of each of its K interfaces two numbers.

    `units` (K,) are seconds per count of time, `before_ip` (K,) bytes before the IP header.
    """

    path: Path
    size: int
    is_big: bool
    is_ng: bool
    units: Array
    before_ip: Ints

    def datagrams(self, n_bytes: int, start: int = 0, stop: int | None = None) -> Iterator[Datagrams]:
        """Yield, piece by piece, the datagrams of `n_bytes` in the records from byte `start` of the file to `stop`.

        InputError is raised where the file ends within a record, or such a datagram was not recorded whole.
        """
        stop = self.size if stop is None else min(stop, self.size)
        start = max(start, 0 if self.is_ng else _HEADER)
        while start < stop:
            data, (records, places, seconds, senders), end, is_whole = self._walked(start, stop, n_bytes)
            at_every_byte = sliding_window_view(data, n_bytes) if len(records) else np.empty((0, n_bytes), np.uint8)
            yield Datagrams(start + records, at_every_byte[places], seconds, senders)
            if not is_whole:
                raise InputError(
                    f"{self.path} holds only the beginning of its packets (byte {start + end}), cut by its recorder or "
                    "sent in fragments; record it again with whole ones: tcpdump -s 0, and an MTU above their size"
                )
            is_last = start + len(data) == stop
            if end < len(data) and (stop == self.size if is_last else end == 0):
                raise InputError(
                    f"{self.path} ends within a packet (byte {start + end} of {self.size}); copy it again or, if its "
                    f"recorder was killed, keep what is whole: editcap -F pcap {self.path.name} whole.pcap"
                )
            start = stop if is_last else start + end

    def sizes(self, stop: int) -> set[int]:
        """Return of how many bytes the datagrams are in the records before byte `stop` of the file, 16 MB at most."""
        data, (_, places, *_), *_ = self._walked(0 if self.is_ng else _HEADER, min(stop, self.size), _ANY)
        return set((data[places - 4].astype(int) << 8 | data[places - 3]) - 8)

    def _walked(
        self, start: int, stop: int, n_bytes: int
    ) -> tuple[npt.NDArray[np.uint8], list[npt.NDArray], int, bool]:
        data = np.fromfile(self.path, np.uint8, max(min(stop - start, _PIECE), 0), offset=start)
        most = len(data) // (n_bytes + _RECORD) + 1
        rows: list[npt.NDArray] = [np.empty(most, kind) for kind in (np.int64, np.int64, np.float64, np.int64)]
        n, end, is_whole = _walk(data, n_bytes, self.is_big, self.is_ng, self.units, self.before_ip, *rows)
        return data, [row[:n] for row in rows], end, is_whole


def open_capture(path: Path) -> Capture:
    """Return the capture at `path`; InputError where it cannot be read, or is none."""
    with damage_reported(path), open(path, "rb") as file:
        head = file.read(_HEADER)
    for order in "<>" if len(head) == _HEADER else "":
        magic, link = struct.unpack(f"{order}I16xI", head)
        if magic in _MAGIC:
            return _capture(path, order, [(link & 0xFFFF, _MAGIC[magic])], is_ng=False)
    if head.startswith(_PCAPNG) and len(head) >= 12:
        order = ">" if head[8:12] == _NG_BIG else "<"
        return _capture(path, order, _interfaces(path, order), is_ng=True)
    raise InputError(f"{path} is not a capture of packets (libpcap); copy it again")


def _capture(path: Path, order: str, interfaces: list[tuple[int, float]], is_ng: bool) -> Capture:
    links = [link for link, _ in interfaces]
    if links and not set(links) & set(_LINKS):
        raise InputError(f"{path} was captured on a link of type {links[0]}, which is not read; capture Ethernet")
    before_ip = np.array([_LINKS.get(link, -1) for link in links], np.int64)
    units = np.array([unit for _, unit in interfaces], np.float64)
    return Capture(path, path.stat().st_size, order == ">", is_ng, units, before_ip)


def _interfaces(path: Path, order: str) -> list[tuple[int, float]]:
    """Return the type of link and the seconds per count of each interface that is told before the first packet."""
    found: list[tuple[int, float]] = []
    at = 0
    with open(path, "rb") as file:
        while True:
            file.seek(at)
            head = file.read(8)
            kind, length = struct.unpack(f"{order}II", head) if len(head) == 8 else (_PACKET, 0)
            if kind in (_PACKET, _OLD_PACKET) or length < 12:
                return found
            if kind == _INTERFACE:
                body = file.read(min(length - 12, _PIECE))
                found.append((struct.unpack_from(f"{order}H", body)[0], _seconds_per_count(body[8:], order)))
            at += length


def _seconds_per_count(options: bytes, order: str) -> float:
    at = 0
    while at + 4 <= len(options):
        code, length = struct.unpack_from(f"{order}HH", options, at)
        if code == 9 and length == 1:  # if_tsresol: a negative power of ten or, with the highest bit, of two
            power = options[at + 4]
            return float(2.0 ** -(power & 127) if power & 128 else 10.0**-power)
        at += 4 + length + -length % 4
    return 1e-6


def require_whole(path: Path) -> None:
    """Raise InputError where a capture ends within a packet."""
    for _ in open_capture(path).datagrams(_NO_SIZE):
        pass


def sender_name(sender: int) -> str:
    """Return a sender's address and port as text that may be part of a path, 192.168.1.201-2368."""
    return f"{IPv4Address(sender >> 16)}-{sender & 0xFFFF}"


@kernel
def _u32(data, at, is_big):  # type: ignore[no-untyped-def]
    a, b, c, d = np.int64(data[at]), np.int64(data[at + 1]), np.int64(data[at + 2]), np.int64(data[at + 3])
    return (a << 24 | b << 16 | c << 8 | d) if is_big else (d << 24 | c << 16 | b << 8 | a)


@kernel
def _u16(data, at):  # type: ignore[no-untyped-def]
    return np.int64(data[at]) << 8 | np.int64(data[at + 1])


@kernel
def _walk(data, n_bytes, is_big, is_ng, units, before_ip, records, places, seconds, senders):  # type: ignore[no-untyped-def]
    """Fill a row for each datagram; return how many, the first record that does not end in `data`, and True.

    Where only the beginning of a datagram was recorded, its record and False.
    """
    n = at = 0
    while at + (12 if is_ng else _RECORD) <= len(data):
        frame, end, following, interface = at + _RECORD, at, at, 0
        if is_ng:
            kind, length = _u32(data, at, is_big), _u32(data, at + 4, is_big)
            following = at + length if length >= 12 else len(data) + 1
            if following <= len(data) and kind in (_PACKET, _OLD_PACKET) and length >= 32:
                frame, interface = at + 28, _u32(data, at + 8, is_big)
                interface = interface if kind == _PACKET else interface >> 16 if is_big else interface & 0xFFFF
                end = min(frame + _u32(data, at + 20, is_big), following)
        else:
            end = following = at + _RECORD + _u32(data, at + 8, is_big)
        if following > len(data):
            break
        ip = udp = -1
        if interface < len(units) and before_ip[interface] >= 0:
            ip, udp = _ip_and_udp(data, frame, end, before_ip[interface])
        if udp >= 0 and (n_bytes == _ANY or _u16(data, udp + 4) == n_bytes + 8):
            if udp + 8 + n_bytes > end:
                return n, at, False
            records[n], places[n] = at, udp + 8
            if is_ng:
                seconds[n] = units[interface] * (_u32(data, at + 12, is_big) << 32 | _u32(data, at + 16, is_big))
            else:
                seconds[n] = _u32(data, at, is_big) + units[0] * _u32(data, at + 4, is_big)
            senders[n] = _u32(data, ip + 12, True) << 16 | _u16(data, udp + 2)
            n += 1
        at = following
    return n, at, True


@kernel
def _ip_and_udp(data, frame, end, before_ip):  # type: ignore[no-untyped-def]
    """Return the bytes at which the headers of IPv4 and UDP begin in a frame, -1 and -1 if it holds no such."""
    ip = frame + before_ip
    if before_ip == 14:
        while ip + 4 <= end and (_u16(data, ip - 2) == 0x8100 or _u16(data, ip - 2) == 0x88A8):  # virtual LANs
            ip += 4
    if ip + 28 > end or data[ip] >> 4 != 4 or data[ip + 9] != 17 or _u16(data, ip + 6) & 0x1FFF:
        return -1, -1
    udp = ip + 4 * (np.int64(data[ip]) & 15)
    return (ip, udp) if udp + 8 <= end else (-1, -1)
