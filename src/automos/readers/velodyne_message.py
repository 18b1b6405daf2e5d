"""The message of Velodyne's driver, VelodyneScan: the packets of about one turn, each with the time it came."""

from __future__ import annotations

import numpy as np

from automos.core.errors import InputError
from automos.readers.pcap import Datagrams
from automos.readers.point_cloud2 import header_end
from automos.readers.velodyne_sweeps import PACKET

TYPE = "velodyne_msgs/msg/VelodyneScan"


def read_packets(raw: bytes, is_ros2: bool, where: str) -> Datagrams:
    """Return the packets of one message as it lies in a bag.

    Raises
    ------
    InputError
        Fewer bytes than its packets need, or no packets.
    """
    order = ">" if is_ros2 and raw[1] == 0 else "<"
    begin = header_end(raw, is_ros2)
    count = int(np.frombuffer(raw, f"{order}u4", 1, begin)[0]) if len(raw) >= begin + 4 else 0
    length = 8 + PACKET
    stride = length + (-length % 4 if is_ros2 else 0)  # CDR starts each time at a multiple of four
    needed = (count - 1) * stride + length
    if count == 0 or len(raw) < begin + 4 + needed:
        raise InputError(f"{where} is cut short: {len(raw)} bytes for {count} packets; record or export it again")
    layout = np.dtype(
        {
            "names": ["seconds", "nanoseconds", "data"],
            "formats": [f"{order}u4", f"{order}u4", f"({PACKET},)u1"],
            "offsets": [0, 4, 8],
            "itemsize": stride,
        }
    )
    rows = np.frombuffer(raw[begin + 4 : begin + 4 + needed] + bytes(stride - length), layout, count)
    none = np.zeros(count, np.int64)
    return Datagrams(none, rows["data"], rows["seconds"] + 1e-9 * rows["nanoseconds"], none)
