"""Packets as the manuals of sensors describe them, byte by byte, made from known ranges and places. For tests only."""

import struct

import numpy as np

DIFOP = bytes.fromhex("A5FF005A11115555")


def hesai(model: str, azimuth: list[int], ranges: np.ndarray, microseconds: int) -> bytes:
    """Return a packet of blocks at azimuths (1/100 degrees) with ranges (blocks, channels) in units of 4 mm.

    Every channel has its number as reflectivity.
    """
    n_blocks, n = ranges.shape
    wide = model.startswith("PandarXT")
    channels = [
        b"".join(struct.pack("<HBx" if wide else "<HB", int(r), k) for k, r in enumerate(row)) for row in ranges
    ]
    sop = b"\xff\xee" if model == "Pandar40P" else b""
    body = b"".join(sop + struct.pack("<H", a) + row for a, row in zip(azimuth, channels, strict=True))
    date = bytes([25, 6, 1, 12, 0, 0])
    if model in ("Pandar40P", "Pandar64"):
        head = b"" if model == "Pandar40P" else bytes([0xEE, 0xFF, 64, 6, 0, 4, 1, 0])
        return head + body + bytes(5) + b"\0" + bytes(2) + struct.pack("<HIBB", 600, microseconds, 0x37, 0x42) + date
    if model == "Pandar128":
        head = bytes([0xEE, 0xFF, 1, 4, 0, 0, 128, 2, 0, 4, 1, 7])
        tail = bytes(9) + struct.pack("<HBBH", 0, 2, 0x37, 600) + date + struct.pack("<IB", microseconds, 0x42)
        return head + body + bytes(4) + bytes(17) + tail + bytes(4) + bytes(22) + bytes(4)
    head = bytes([0xEE, 0xFF, 6, 1, 0, 0, n, n_blocks, 0, 4, 1, 0])
    return head + body + bytes(10) + struct.pack("<BH", 0x37, 600) + date + struct.pack("<IBI", microseconds, 0x42, 7)


def at128(azimuth: list[int], ranges: np.ndarray, microseconds: int, size: int = 1118) -> bytes:
    """Return a packet of an AT128: two blocks at azimuths in 1/25600 degrees, ranges (2, 128) in units of 4 mm.

    Every channel has its number as reflectivity.
    """
    blocks = b"".join(
        struct.pack("<HB", *divmod(a, 256)) + b"".join(struct.pack("<HBB", int(r), k, 1) for k, r in enumerate(row))
        for a, row in zip(azimuth, ranges, strict=True)
    )
    head = bytes([0xEE, 0xFF, 4, 3, 0, 0, 128, 2, 0, 4, 1, 9])
    tail = bytes(18) + struct.pack("<hIBB", 2000, microseconds, 0x37, 0x42) + bytes([125, 6, 1, 12, 0, 0])
    return (head + blocks + bytes(4) + tail).ljust(size, b"\0")


def correction(starts: list[int], azimuth: np.ndarray, elevation: np.ndarray, bent: np.ndarray, unit: int = 1) -> bytes:
    """Return an AT128's angle correction file 1.5: angles in `unit`/25600 degrees, bent (2, 128, 180) in unit/100."""
    head = bytes([0xEE, 0xFF, 1, 5, 128, 3, 3, 1, 2, 4, 0, 0, 0, 0, 0, unit])
    angles = struct.pack("<6I256i", *starts, *starts[1:], starts[0], *azimuth, *elevation)
    return head + angles + bent.astype("i1").tobytes() + bytes(32)


def robosense(model: int, azimuth: list[int], ranges: np.ndarray, microseconds: int) -> bytes:
    """Return a packet of an RS-LiDAR-16 (1) or -32 (2) of 12 blocks; ranges (12, 32) in units of 5 mm."""
    stamp = bytes([25, 6, 1, 12, 0, 0]) + struct.pack(">HH", *divmod(microseconds, 1000))
    head = bytes.fromhex("55AA050A5AA550A0") + bytes(12) + stamp + bytes([model]) + bytes(11)
    rows = [b"".join(struct.pack(">HB", int(r), k) for k, r in enumerate(row)) for row in ranges]
    return (
        head
        + b"".join(b"\xff\xee" + struct.pack(">H", a) + row for a, row in zip(azimuth, rows, strict=True))
        + bytes([0, 0, 0, 0, 0, 255])
    )


def difop16(elevation: np.ndarray) -> bytes:
    """Return what an RS-LiDAR-16 tells of its beams (16,), degrees."""
    pitches = b"".join(round(1e4 * abs(e)).to_bytes(3, "big") for e in elevation)
    return (DIFOP + bytes(1157) + pitches).ljust(1246, b"\0") + b"\x0f\xf0"


def difop32(elevation: np.ndarray, azimuth: np.ndarray) -> bytes:
    """Return what an RS-LiDAR-32 tells of its beams (32,), degrees."""
    angles = b"".join(struct.pack(">BH", int(a < 0), round(1000 * abs(a))) for a in (*elevation, *azimuth))
    return (DIFOP + bytes(460) + angles).ljust(1246, b"\0") + b"\x0f\xf0"


def m1(number: int, seconds: float, ranges: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> bytes:
    """Return a packet of an RS-LiDAR-M1: ranges (25, 5) in units of 5 mm, angles in 1/100 degrees."""
    whole, rest = divmod(round(1e6 * seconds), 10**6)
    stamp = whole.to_bytes(6, "big") + rest.to_bytes(4, "big")
    head = bytes.fromhex("55AA5AA5") + struct.pack(">HHBB", number, 1, 4, 1) + stamp + bytes(10) + bytes([16, 90])
    blocks = b""
    for k in range(25):
        points = zip(ranges[k], pitch[k], yaw[k], strict=True)
        blocks += bytes([k, 0]) + b"".join(
            struct.pack(">HHHBBB", int(r), int(p) + 32768, int(y) + 32768, 77, 0, 0) for r, p, y in points
        )
    return head + blocks + bytes(3)


def livox_points(kind: int, rows: np.ndarray, *, is_second: bool) -> bytes:
    """Return points as either protocol packs them; rows are x y z, or range zenith around, and the intensity."""
    codes = {1: "<iiiBx", 2: "<hhhBx", 3: "<IHHBx"} if is_second else {
        0: "<iiiB", 1: "<IHHB", 2: "<iiiBx", 3: "<IHHBx", 4: "<iiiBx", 7: "<iiiBx",
    }  # fmt: skip
    return b"".join(struct.pack(codes[kind], *map(int, row)) for row in rows)


def mid360(kind: int, rows: np.ndarray, nanoseconds: int, number: int = 0) -> bytes:
    """Return a packet of a Mid-360 or HAP."""
    points = livox_points(kind, rows, is_second=True)
    head = struct.pack("<BHHHHBBB12xI", 0, 36 + len(points), 4700, len(rows), number, 1, kind, 0, 0)
    return head + struct.pack("<Q", nanoseconds) + points


def avia(kind: int, rows: np.ndarray, nanoseconds: int) -> bytes:
    """Return a packet of an Avia."""
    points = livox_points(kind, rows, is_second=False)
    return struct.pack("<BBBBIBBQ", 5, 1, 1, 0, 0, 0, kind, nanoseconds) + points


def lvx(packets: list[list[bytes]]) -> bytes:
    """Return a .lvx of frames of an Avia's packets."""
    head = b"livox_tech".ljust(16, b"\0") + bytes([1, 1, 0, 0]) + struct.pack("<IIB", 0xAC0EA767, 50, 1)
    head += b"3JEDHB".ljust(16, b"\0") + bytes(16) + bytes([0, 7, 0]) + bytes(24)
    return _in_frames(head, [[b"\0" + packet for packet in frame] for frame in packets])


def lvx2(packets: list[list[bytes]]) -> bytes:
    """Return a .lvx2 of frames of a Mid-360's packets."""
    head = b"livox_tech".ljust(16, b"\0") + bytes([2, 0, 0, 0]) + struct.pack("<IIB", 0xAC0EA767, 50, 1)
    head += b"47MDK".ljust(16, b"\0") + bytes(16) + struct.pack("<IBBB", 7, 0, 9, 0) + bytes(24)

    def package(packet: bytes) -> bytes:
        time, number = packet[28:36], packet[7:9]
        middle = b"\0" + struct.pack("<IBB", 7, 8, 0) + time + number + packet[10:11]
        return middle + struct.pack("<IB4x", len(packet) - 36, 1) + packet[36:]

    return _in_frames(head, [list(map(package, frame)) for frame in packets])


def _in_frames(head: bytes, frames: list[list[bytes]]) -> bytes:
    for k, frame in enumerate(frames):
        body = b"".join(frame)
        head += struct.pack("<QQQ", len(head), len(head) + 24 + len(body), k) + body
    return head
