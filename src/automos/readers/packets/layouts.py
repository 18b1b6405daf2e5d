"""What the packets of each sensor hold, as its public manual says: a row for each kind of packet.

A row tells how to know such packets from others and where their numbers are; `decode` reads all of them alike. To read
another sensor is to add a row here and, for one whose beams are fixed, its angles to `beams.json`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Array, Ints, Mask
from automos.readers.packets.pcap import Datagrams

_COUNTS = {"milli": 1e-3, "micro": 1e-6, "nano": 1e-9}
"""Seconds that each part of a clock counts."""
_FRAME = 100_000_000
"""Nanoseconds of a scan of sensors whose pattern does not repeat, as their drivers cut it."""
_IN_TURN = 28
"""Of 36000 that a turn has, for each packet of a sensor that counts them anew in each frame (up to 1260)."""


@dataclass(frozen=True, eq=False)
class Layout:
    """One kind of packet.

    Attributes
    ----------
    sensor : its name, by which its beams are found.
    marks : bytes that such packets have at a place each.
    dtype : one packet. `points` lie in it, or in its `blocks` of one `azimuth` (1/100 degrees, and `fine` 1/256 of
        these) each; they have x, y and z, a range and two angles, or a range along a beam. `milli`, `micro`, `nano` are
        its clock, `number` its own.
    unit : metres that their lengths count.
    hour : seconds after which the clock begins anew, 0 where it does not.
    ahead : degrees counter-clockwise from x at which the azimuth is 0.
    fired : (C,) when each point of a block is measured, as a share of the time until the next block.
    lens : metres from the axis to where the rays begin.
    mirrors : how often it looks ahead in a turn, a scan each; in between, where the azimuth is 0, it sees nothing.
    """

    sensor: str
    marks: dict[int, bytes]
    dtype: np.dtype
    unit: float = 1e-3
    hour: float = 1.0
    ahead: float = 0.0
    fired: tuple[float, ...] = (0.0,)
    lens: float = 0.0
    mirrors: int = 1

    @property
    def names(self) -> tuple[str, ...]:
        """What a packet holds."""
        return self.dtype.names or ()

    @property
    def size(self) -> int:
        """Bytes of a packet."""
        return self.dtype.itemsize

    @property
    def turns(self) -> bool:
        """Whether the sensor turns, so that its beams are what its points lie along."""
        return "blocks" in self.names and "azimuth" in (self.dtype["blocks"].base.names or ())

    def are_own(self, payloads: npt.NDArray[np.uint8]) -> Mask:
        """Return (N,) which of some payloads (N, size) are such packets."""
        found = np.ones(len(payloads), bool)
        for at, mark in self.marks.items():
            found &= (payloads[:, at : at + len(mark)] == np.frombuffer(mark, np.uint8)).all(axis=1)
        return found

    def rows(self, packets: Datagrams) -> npt.NDArray:
        """Return (N,) packets as what they are."""
        return np.ascontiguousarray(packets.payloads).view(self.dtype)[:, 0]

    def clock(self, packets: Datagrams) -> Array:
        """Return (N,) seconds on the sensor's clock since that of the first began anew.

        How often it did so between two packets is what brings it nearest to the times of recording.
        """
        rows = self.rows(packets)
        parts = [count * rows[name].astype(np.float64) for name, count in _COUNTS.items() if name in self.names]
        seconds = np.sum(parts, axis=0)
        if self.hour:
            anew = np.round((np.diff(packets.seconds) - np.diff(seconds)) / self.hour)
            seconds[1:] += self.hour * np.cumsum(anew)
        return seconds

    def turned(self, packets: Datagrams) -> Ints:
        """Return (N,) how far the sensor has come in its turn or frame at each packet, in 1/36000 of it."""
        rows = self.rows(packets)
        if self.turns:
            return self.mirrors * rows["blocks"]["azimuth"][:, 0].astype(np.int64) % 36000
        if "number" in self.names:
            return _IN_TURN * rows["number"].astype(np.int64)
        return (36000 * (rows["nano"] % _FRAME) // _FRAME).astype(np.int64)


def _at(size: int, **fields: tuple[Any, int]) -> np.dtype:
    """Return `size` bytes, of which each field of some type begins at a byte."""
    kinds, places = zip(*fields.values(), strict=True)
    return np.dtype({"names": list(fields), "formats": kinds, "offsets": places, "itemsize": size})


def _block(n: int, of: int, before: int = 2, order: str = "<") -> np.dtype:
    """Return a block of `n` points of `of` bytes each behind `before` bytes, of which the last two are its azimuth."""
    point = _at(of, range=(f"{order}u2", 0), intensity=("u1", 2))
    return _at(before + n * of, azimuth=(f"{order}u2", before - 2), points=((point, (n,)), before))


def _hesai(
    sensor: str, sizes: tuple[int, ...], mark: str, blocks: tuple[int, int, np.dtype], micro: int, mirrors: int = 1
) -> list[Layout]:
    """Return a row for each of some sizes: blocks begin at a byte, so many, of a kind; the clock is at byte `micro`.

    mark : hexadecimal, what a packet begins with and, behind a blank, what is at byte 6.
    """
    start, n, block = blocks
    marks = dict(zip((0, 6), map(bytes.fromhex, mark.split()), strict=False))
    packets = [_at(size, blocks=((block, (n,)), start), micro=("<u4", micro)) for size in sizes]
    return [Layout(sensor, marks, packet, unit=4e-3, ahead=90.0, mirrors=mirrors) for packet in packets]


def _robosense(sensor: str, number: int, fired: tuple[float, ...], lens: float) -> Layout:
    packet = _at(1248, blocks=((_block(32, 3, 4, ">"), (12,)), 42), milli=(">u2", 26), micro=(">u2", 28))
    marks = {0: bytes.fromhex("55AA050A5AA550A0"), 30: bytes([number])}
    return Layout(sensor, marks, packet, unit=5e-3, fired=fired, lens=lens)


def _livox(
    points: dict[int, tuple[np.dtype, int, float]], head: int, kind_at: int, nano: int, version: bytes = b""
) -> list[Layout]:
    """Return a row for each data type of `points`, which begin behind `head` bytes; the clock is at byte `nano`.

    kind_at : the byte that tells the type. A packet begins with the `version` and, of the second protocol, its size.
    """
    rows = []
    for kind, (point, n, unit) in points.items():
        packet = _at(head + n * point.itemsize, points=((point, (n,)), head), nano=("<u8", nano))
        begin = version + (packet.itemsize.to_bytes(2, "little") if version == _SECOND else b"")
        marks = {kind_at: bytes([kind])} | ({0: begin} if begin else {})
        rows.append(Layout("Livox", marks, packet, unit, hour=0.0))
    return rows


def _lengths(kind: str, size: int) -> np.dtype:
    step = np.dtype(kind).itemsize
    return _at(size, x=(kind, 0), y=(kind, step), z=(kind, 2 * step), intensity=("u1", 3 * step))


def _rays(size: int) -> np.dtype:
    return _at(size, range=("<u4", 0), zenith=("<u2", 4), around=("<u2", 6), intensity=("u1", 8))


_FINE_BLOCK = _at(515, azimuth=("<u2", 0), fine=("u1", 2), points=(_block(128, 4)["points"], 3))
_M1_POINT = _at(9, range=(">u2", 0), pitch=(">u2", 2), yaw=(">u2", 4), intensity=("u1", 6))
_M1 = _at(1210, number=(">u2", 4), micro=(">u4", 16), blocks=((_at(47, points=((_M1_POINT, (5,)), 2)), (25,)), 32))
_FIRST, _SECOND = b"\x05", b"\0"
"""Versions of Livox's protocols: of Avia, Horizon, Mid-40, Mid-70 and Tele-15; of Mid-360 and HAP."""
_LENGTHS = _lengths("<i4", 14)
_OF_FIRST = {
    0: (_lengths("<i4", 13), 100, 1e-3), 1: (_rays(9), 100, 1e-3), 2: (_LENGTHS, 96, 1e-3), 3: (_rays(10), 96, 1e-3),
    4: (_LENGTHS, 96, 1e-3), 7: (_LENGTHS, 90, 1e-3),
}  # fmt: skip
_OF_SECOND = {1: (_LENGTHS, 96, 1e-3), 2: (_lengths("<i2", 8), 96, 1e-2), 3: (_rays(10), 96, 1e-3)}
"""Points of their data types, how many are in a packet, and their unit; several returns of a ray follow one another."""
VELODYNE = Layout(
    "Velodyne", {0: b"\xff\xee"}, _at(1206, blocks=((_block(32, 3, 4), (12,)), 0), micro=("<u4", 1200)), hour=3600.0
)
"""Points of these are decoded by another's library, which knows their calibration."""
LAYOUTS = (
    VELODYNE,
    *_hesai("Pandar40P", (1262, 1266), "FFEE", (0, 10, _block(40, 3, 4)), 1250),  # no header: blocks begin with these
    *_hesai("Pandar64", (1194, 1198), "EEFF4006", (8, 6, _block(64, 3)), 1182),
    *_hesai("Pandar128", (861, 893), "EEFF0104 8002", (12, 2, _block(128, 3)), 826),
    *_hesai("PandarXT-16", (568,), "EEFF0601 1008", (12, 8, _block(16, 4)), 559),
    *_hesai("PandarXT-32", (1080,), "EEFF0601 2008", (12, 8, _block(32, 4)), 1071),
    *_hesai("PandarXT-32M", (820,), "EEFF0601 2006", (12, 6, _block(32, 4)), 811),
    # with its number, a sum of its bytes, a signature
    *_hesai("Hesai AT128", (1078, 1082, 1086, 1118), "EEFF0403 8002", (12, 2, _FINE_BLOCK), 1066, mirrors=3),
    _robosense("RS-LiDAR-16", 1, tuple((k * 55.5 + c * 2.8) / 111.0 for k in range(2) for c in range(16)), 0.03825),
    _robosense(
        *("RS-LiDAR-32", 2),
        tuple((c % 16 * 2.88 + c // 16 * 1.44 + (c % 16 == 15) * 1.44) / 55.52 for c in range(32)),
        0.03997,
    ),
    Layout("RS-LiDAR-M1", {0: bytes.fromhex("55AA5AA5")}, _M1, unit=5e-3),
    *_livox(_OF_FIRST, 18, 9, 10, _FIRST),
    *_livox(_OF_SECOND, 36, 10, 28, _SECOND),
)
LVX, LVX2 = tuple(_livox(_OF_FIRST, 19, 10, 11)), tuple(_livox(_OF_SECOND, 27, 17, 7))
"""Packages of Livox's own files: of its first, as they were sent behind the number of the sensor; of its second."""


def layout_of(payload: bytes) -> Layout | None:
    """Return the kind of a packet, None of one that is not known."""
    row = np.frombuffer(payload, np.uint8)[None]
    return next((layout for layout in LAYOUTS if layout.size == len(payload) and layout.are_own(row)[0]), None)
