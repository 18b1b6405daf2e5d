"""Captures of a VLP-16 as its manual describes them, made from known ranges. For tests only."""

import struct
from pathlib import Path

import numpy as np

ELEVATIONS = np.array([-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15], float)
"""(16,) degrees, in the order of firing."""
CYCLE, CHANNEL = 55.296e-6, 2.304e-6
"""Seconds between firings of all channels, and between those of successive channels."""
VLP16, STRONGEST, DUAL = 0x22, 0x37, 0x39


def firings(n: int, first_azimuth: float = 0.0, period: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 16) azimuths, degrees clockwise from ahead, and seconds of `n` firings of all channels."""
    times = CYCLE * np.arange(n)[:, None] + CHANNEL * np.arange(16)
    return first_azimuth + 360.0 / period * times, times


def to_points(distance: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Return (n, 16, 3) points, metres, x ahead, y left, z up, of ranges and azimuths (n, 16)."""
    a, e = np.radians(azimuth), np.radians(ELEVATIONS)
    level = distance * np.cos(e)
    return np.stack([level * np.cos(a), -level * np.sin(a), distance * np.sin(e)], axis=-1)


def data_packets(
    distance: np.ndarray,
    reflectivity: np.ndarray,
    azimuth: np.ndarray,
    start: float = 0.0,
    second: tuple[np.ndarray, np.ndarray] | None = None,
    model: int = VLP16,
) -> list[tuple[float, bytes]]:
    """Return (seconds since `start`'s hour's first, 1206 bytes) of every packet.

    distance : (n, 16) metres, 0 where there was no return; n is a multiple of 24 (of 12 with `second`).
    reflectivity : (n, 16) uint8;  azimuth : (n, 16) degrees, as `firings` makes it.
    start : seconds of the first firing on the sensor's clock.
    second : distance and reflectivity of the other return, written as the block before.
    """
    n = len(distance)
    returns = [(distance, reflectivity)] if second is None else [second, (distance, reflectivity)]
    sets = 12 // len(returns)
    assert n % (2 * sets) == 0
    channels = np.zeros((n // 2, len(returns), 32), [("range", "<u2"), ("reflectivity", "u1")])
    for k, (metres, strength) in enumerate(returns):
        channels["range"][:, k] = np.round(np.asarray(metres) / 0.002).reshape(-1, 32)
        channels["reflectivity"][:, k] = np.asarray(strength).reshape(-1, 32)
    blocks = np.zeros(channels.shape[:2], [("flag", "<u2"), ("azimuth", "<u2"), ("channels", channels.dtype, 32)])
    blocks["flag"], blocks["channels"] = 0xEEFF, channels
    blocks["azimuth"] = (np.round(100 * azimuth[::2, 0]) % 36000)[:, None]
    mode = STRONGEST if second is None else DUAL
    packets = []
    for first in range(0, n // 2, sets):
        seconds = start + 2 * first * CYCLE
        microseconds = round(1e6 * seconds) % 3_600_000_000
        packets.append(
            (seconds, blocks[first : first + sets].tobytes() + struct.pack("<IBB", microseconds, mode, model))
        )
    return packets


def udp(payload: bytes, source: str = "192.168.1.201", port: int = 2368) -> bytes:
    """Return the Ethernet frame of a datagram."""
    address = bytes(map(int, source.split(".")))
    datagram = struct.pack(">HHHH", port, port, 8 + len(payload), 0) + payload
    header = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(datagram), 0, 0, 64, 17, 0, address, b"\xff" * 4)
    return b"\xff" * 6 + b"\x60\x76\x88\x00\x00\x00" + b"\x08\x00" + header + datagram


def write_pcap(
    path: Path, frames: list[tuple[float, bytes]], order: str = "<", nano: bool = False, link: int = 1
) -> Path:
    """Write (seconds, frame) as a classic capture file, in one of its byte orders and units of time."""
    magic, unit = (0xA1B23C4D, 1e9) if nano else (0xA1B2C3D4, 1e6)
    with open(path, "wb") as file:
        file.write(struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link))
        for seconds, frame in frames:
            fraction = round(unit * (seconds % 1))
            file.write(struct.pack(order + "IIII", int(seconds), fraction, len(frame), len(frame)) + frame)
    return path


def write_pcapng(
    path: Path,
    frames: list[tuple[float, bytes]],
    order: str = "<",
    resolution: int = 6,
    link: int = 1,
    other: int = 113,
) -> Path:
    """Write (seconds, frame) as Wireshark does: comments and names between packets, times in 10^-resolution s or,
    with the highest bit set, in powers of two."""
    unit = 2.0 ** (resolution & 127) if resolution & 128 else 10.0**resolution

    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        return struct.pack(order + "II", kind, 12 + len(body)) + body + struct.pack(order + "I", 12 + len(body))

    with open(path, "wb") as file:
        file.write(block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1)))
        for number in (other, link):  # the first has no packets
            options = struct.pack(order + "HHB3xHH", 9, 1, resolution, 0, 0)
            file.write(block(1, struct.pack(order + "HHI", number, 0, 0) + options))
        for k, (seconds, frame) in enumerate(frames):
            time = round(seconds * unit)
            head = struct.pack(order + "IIIII", 1, time >> 32, time & 0xFFFFFFFF, len(frame), len(frame))
            file.write(
                block(6, head + frame + bytes(-len(frame) % 4) + struct.pack(order + "HH4sHH", 1, 4, b"note", 0, 0))
            )
            if k % 7 == 3:
                file.write(block(4, bytes(4)))  # names of addresses
    return path


HDL64_ELEVATIONS = np.round(np.r_[2.0 - np.arange(32) / 3.0, -8.83 - 0.5 * np.arange(32)], 2)
"""(64,) degrees, upper block first."""


def hdl64e_packets(distance: np.ndarray, azimuth: np.ndarray, period: float = 0.1) -> list[tuple[float, bytes]]:
    """Return (seconds, 1206 bytes) of the packets of an HDL-64E S3 that tells its calibration, a byte a packet.

    distance : (n, 64) metres, n a multiple of 6, n / 6 at least 4160 to tell all;  azimuth : (n,) degrees.
    """
    n = len(distance)
    channels = np.zeros((n, 64), [("range", "<u2"), ("reflectivity", "u1")])
    channels["range"], channels["reflectivity"] = np.round(distance / 0.002), 100
    blocks = np.zeros((n, 2), [("flag", "<u2"), ("azimuth", "<u2"), ("channels", channels.dtype, 32)])
    blocks["flag"], blocks["channels"] = [0xEEFF, 0xDDFF], channels.reshape(n, 2, 32)
    blocks["azimuth"] = (np.round(100 * azimuth) % 36000)[:, None]
    told, values = dict(zip("HMSDNYGTV", (12, 30, 15, 3, 6, 20, 65, 40, 160), strict=True)), iter(_calibration())
    step = period / 360.0 * (azimuth[1] - azimuth[0])
    packets = []
    for k in range(n // 6):
        sign = "HMSDNYGTVW234567"[k % 16]
        value = told[sign] if sign in told else next(values, 0)
        clock = struct.pack("<IBB", round(1e6 * 6 * k * step), ord(sign), value)
        packets.append((6 * k * step, blocks[6 * k : 6 * k + 6].tobytes() + clock))
    return packets


def _calibration() -> bytes:
    """Return the 1820 bytes of a sensor whose beams leave its middle at HDL64_ELEVATIONS."""
    lasers = [struct.pack("<B9hBB", k, round(100 * e), *[0] * 8, 0, 255) for k, e in enumerate(HDL64_ELEVATIONS)]
    date = bytes((20, 3, 15, 12, 30, 5, 40))  # of the calibration, after the last laser
    table = b"UNIT#\0\0" + b"".join(laser + date for laser in lasers) + bytes(19)
    crc = 0
    for byte in b"".join(laser[1:] for laser in lasers):  # CRC-16, polynomial 0x8005
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return table + struct.pack("<H", crc)
