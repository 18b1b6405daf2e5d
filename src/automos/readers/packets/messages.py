"""Messages of drivers that hold packets: those of about one turn, each with the time it came, or a single one."""

import struct
from collections.abc import Iterable
from contextlib import suppress

import numpy as np

from automos.core.arrays import Ints
from automos.core.errors import InputError
from automos.readers.packets.pcap import Datagrams
from automos.readers.records import require_bytes
from automos.readers.wire import Wire

_SCANS = {
    "velodyne_msgs/msg/VelodyneScan": (1206, False),
    "pandar_msgs/msg/PandarScan": (1500, True),
    "hesai_ros_driver/msg/UdpFrame": (0, True),
    "rslidar_msgs/msg/rslidarScan": (1248, False),
    "rslidar_msg/msg/RslidarScan": (1248, False),
    "robosense_msgs/msg/RobosenseScan": (1248, False),
    "nebula_msgs/msg/NebulaPackets": (0, False),
}
"""Bytes of each packet (0: they are counted before it), and whether a number behind it says how many are of use."""
_SINGLE = "rslidar_msg/msg/RslidarPacket"
TYPES = (*_SCANS, _SINGLE)


def rows_of_scans(rows: Ints, heads: Iterable[bytes], kind: str, is_ros2: bool, where: str) -> list[Ints]:
    """Return the rows (N, 4) of messages, whose beginnings are `heads`, cut into those of a scan each.

    A message is a scan unless it holds a single packet; of these, the driver says which is the first.

    Raises
    ------
    InputError
        It says so of none; `where` is what they are of.
    """
    if kind != _SINGLE:
        return [row[None] for row in rows]
    is_first = [Wire.behind_header(raw, is_ros2).take(2) == b"\0\1" for raw in heads]
    if not any(is_first):
        raise InputError(f"{where} does not say which packets begin a scan; record the points instead")
    return np.split(rows, np.flatnonzero(is_first))[1:]


def read_packets(raw: bytes, kind: str, is_ros2: bool, where: str) -> list[tuple[float, bytes]]:
    """Return the packets of one message as it lies in a bag, each with the seconds at which it came.

    Raises
    ------
    InputError
        Fewer bytes than its packets need, or no packets.
    """
    found: list[tuple[float, bytes]] = []
    count, needed = 0, len(raw) + 1
    with suppress(struct.error):
        here = Wire.behind_header(raw, is_ros2)
        if kind == _SINGLE:
            stamp = Wire(raw, is_ros2).seconds()
            here.take(2)  # whether it tells of the sensor, and whether it begins a scan
            found, count = [(stamp, here.text())], 1
        fixed, has_size = _SCANS.get(kind, (0, False))
        count = count or here.number()
        while len(found) < count:
            stamp = here.seconds()
            packet = here.take(fixed or here.number())
            found.append((stamp, packet[: here.number()] if has_size else packet))
        needed = here.at if found else needed
    require_bytes(where, len(raw), needed, f"{count} packets")
    return found


def as_datagrams(packets: Iterable[tuple[float, bytes]], size: int, where: str) -> Datagrams:
    """Return those packets that have `size` bytes: others tell what the sensor is, or how it is.

    Raises
    ------
    InputError
        There are none; `where` is what they are of.
    """
    kept = [(seconds, packet) for seconds, packet in packets if len(packet) == size]
    if not kept:
        raise InputError(f"{where} holds no packets of points as those before it do; record or export it again")
    payloads = np.frombuffer(b"".join(packet for _, packet in kept), np.uint8).reshape(-1, size)
    none = np.zeros(len(kept), np.int64)
    return Datagrams(none, payloads, np.array([seconds for seconds, _ in kept]), none)
