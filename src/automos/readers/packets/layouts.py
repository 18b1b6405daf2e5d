"""What the packets of each sensor hold, as its public manual says: a row for each kind of packet.

A row tells how to know such packets from others and where their numbers are; `decode` reads all of them alike. To read
another sensor is to add a row here and, for one whose beams are fixed, its angles to `beams.json`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

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

    def are_own(self, payloads: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
        """Return (N,) which of some payloads (N, size) are such packets."""
        found = np.ones(len(payloads), bool)
        for at, mark in self.marks.items():
            found &= (payloads[:, at : at + len(mark)] == np.frombuffer(mark, np.uint8)).all(axis=1)
        return found

    def rows(self, packets: Datagrams) -> npt.NDArray:
        """Return (N,) packets as what they are."""
        return np.ascontiguousarray(packets.payloads).view(self.dtype)[:, 0]

    def clock(self, packets: Datagrams) -> npt.NDArray[np.float64]:
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

    def turned(self, packets: Datagrams) -> npt.NDArray[np.int64]:
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


def _return(order: str, size: int) -> np.dtype:
    return _at(size, range=(f"{order}u2", 0), intensity=("u1", 2))


def _hesai(sensor: str, sizes: tuple[int, ...], mark: bytes, blocks: tuple[int, int, int], of: int, micro: int) -> list:
    """Return rows: `blocks` begin at a byte, so many, of so many points of `of` bytes; the clock is at byte `micro`."""
    begin, n, channels = blocks
    before = 4 if begin == 0 else 2  # the Pandar40P has no header, but begins each block with two bytes
    block = _at(before + of * channels, azimuth=("<u2", before - 2), points=((_return("<", of), (channels,)), before))
    return [
        Layout(
            *(sensor, {0: mark[:4]} | ({6: mark[4:]} if mark[4:] else {})),
            _at(size, blocks=((block, (n,)), begin), micro=("<u4", micro)),
            *(4e-3, 1.0, 90.0),
        )
        for size in sizes
    ]


def _robosense(sensor: str, number: int, fired: tuple[float, ...], lens: float) -> Layout:
    block = _at(100, azimuth=(">u2", 2), points=((_return(">", 3), (32,)), 4))
    dtype = _at(1248, blocks=((block, (12,)), 42), milli=(">u2", 26), micro=(">u2", 28))
    marks = {0: bytes.fromhex("55AA050A5AA550A0"), 30: bytes([number])}
    return Layout(sensor, marks, dtype, 5e-3, 1.0, 0.0, fired, lens)


_FINE_BLOCK = _at(515, azimuth=("<u2", 0), fine=("u1", 2), points=((_return("<", 4), (128,)), 3))
_M1_POINT = _at(9, range=(">u2", 0), pitch=(">u2", 2), yaw=(">u2", 4), intensity=("u1", 6))
_M1 = _at(1210, number=(">u2", 4), micro=(">u4", 16), blocks=((_at(47, points=((_M1_POINT, (5,)), 2)), (25,)), 32))
_LENGTHS = _at(14, x=("<i4", 0), y=("<i4", 4), z=("<i4", 8), intensity=("u1", 12))
_CENTIMETRES = _at(8, x=("<i2", 0), y=("<i2", 2), z=("<i2", 4), intensity=("u1", 6))
_RAYS = _at(10, range=("<u4", 0), zenith=("<u2", 4), around=("<u2", 6), intensity=("u1", 8))
_PLAIN = _at(13, x=("<i4", 0), y=("<i4", 4), z=("<i4", 8), intensity=("u1", 12))
_PLAIN_RAYS = _at(9, range=("<u4", 0), zenith=("<u2", 4), around=("<u2", 6), intensity=("u1", 8))
_SECOND = {1: (_LENGTHS, 96, 1e-3), 2: (_CENTIMETRES, 96, 1e-2), 3: (_RAYS, 96, 1e-3)}
"""Points of each data type of Livox's second protocol (Mid-360, HAP), how many are in a packet, and their unit."""
_FIRST = {
    0: (_PLAIN, 100, 1e-3), 1: (_PLAIN_RAYS, 100, 1e-3), 2: (_LENGTHS, 96, 1e-3), 3: (_RAYS, 96, 1e-3),
    4: (_LENGTHS, 96, 1e-3), 7: (_LENGTHS, 90, 1e-3),
}  # fmt: skip
"""Those of its first (Avia, Horizon, Mid-40, Mid-70, Tele-15); several returns of a ray follow one another."""


def _livox(sensor: str, head: int, kinds: dict, marks: dict[int, bytes], kind_at: int, nano: int) -> list[Layout]:
    return [
        Layout(
            *(sensor, {kind_at: bytes([kind])} | marks),
            _at(head + n * point.itemsize, points=((point, (n,)), head), nano=("<u8", nano)),
            *(unit, 0.0),
        )
        for kind, (point, n, unit) in kinds.items()
    ]


_XT = bytes.fromhex("EEFF0601")
VELODYNE = Layout(
    "Velodyne",
    {0: b"\xff\xee"},
    _at(1206, blocks=((_at(100, azimuth=("<u2", 2)), (12,)), 0), micro=("<u4", 1200)),
    hour=3600.0,
)
"""Points of these are decoded by another's library, which knows their calibration."""
LAYOUTS = (
    VELODYNE,
    *_hesai("Pandar40P", (1262, 1266), b"\xff\xee", (0, 10, 40), 3, 1250),
    *_hesai("Pandar64", (1194, 1198), bytes.fromhex("EEFF4006"), (8, 6, 64), 3, 1182),
    *_hesai("Pandar128", (861, 893), bytes.fromhex("EEFF01048002"), (12, 2, 128), 3, 826),
    *_hesai("PandarXT-16", (568,), _XT + bytes([16, 8]), (12, 8, 16), 4, 559),
    *_hesai("PandarXT-32", (1080,), _XT + bytes([32, 8]), (12, 8, 32), 4, 1071),
    *_hesai("PandarXT-32M", (820,), _XT + bytes([32, 6]), (12, 6, 32), 4, 811),
    *(
        Layout(
            *("Hesai AT128", {0: bytes.fromhex("EEFF0403"), 6: bytes([128, 2])}),
            _at(size, blocks=((_FINE_BLOCK, (2,)), 12), micro=("<u4", 1066)),
            *(4e-3, 1.0, 90.0),
            mirrors=3,
        )
        for size in (1078, 1082, 1086, 1118)  # with its number, a sum of its bytes, a signature
    ),
    _robosense("RS-LiDAR-16", 1, tuple((k * 55.5 + c * 2.8) / 111.0 for k in range(2) for c in range(16)), 0.03825),
    _robosense(
        *("RS-LiDAR-32", 2),
        tuple((c % 16 * 2.88 + c // 16 * 1.44 + (c % 16 == 15) * 1.44) / 55.52 for c in range(32)),
        0.03997,
    ),
    Layout("RS-LiDAR-M1", {0: bytes.fromhex("55AA5AA5")}, _M1, 5e-3),
    *_livox("Livox", 18, _FIRST, {0: b"\x05"}, 9, 10),
    *(
        layout
        for kind, (point, n, _) in _SECOND.items()
        for layout in _livox(
            "Livox", 36, {kind: _SECOND[kind]}, {0: b"\0" + (36 + n * point.itemsize).to_bytes(2, "little")}, 10, 28
        )
    ),
)  # fmt: skip
LVX, LVX2 = tuple(_livox("Livox", 19, _FIRST, {}, 10, 11)), tuple(_livox("Livox", 27, _SECOND, {}, 17, 7))
"""Packages of Livox's own files: of its first, as they were sent behind the number of the sensor; of its second."""


def layout_of(payload: bytes) -> Layout | None:
    """Return the kind of a packet, None of one that is not known."""
    row = np.frombuffer(payload, np.uint8)[None]
    return next((layout for layout in LAYOUTS if layout.size == len(payload) and layout.are_own(row)[0]), None)
