"""The message of Livox's own drivers, CustomMsg: points one after the other with their time, line and tag.

Drivers for ROS 1 and ROS 2 give it the same fields under different package names. It is taken apart here, as it is on
the wire: decoding a hundred thousand points as messages of their own takes seconds a scan.
"""

import numpy as np

from automos.core.errors import InputError
from automos.readers.columns import Columns

TYPES = tuple(f"{package}/msg/CustomMsg" for package in ("livox_ros_driver", "livox_ros_driver2", "livox_interfaces"))

_POINT = (("offset_time", "u4"), ("x", "f4"), ("y", "f4"), ("z", "f4"), ("reflectivity", "u1"), ("tag", "u1"))
LENGTH = 19
"""Bytes of a point: the fields above and its line. CDR, of ROS 2, starts each at a multiple of four."""


def read_columns(raw: bytes | memoryview, is_ros2: bool, where: str) -> Columns:
    """Return the columns of one message as it lies in a bag: x, y, z, reflectivity, line, offset_time (ns), each (N,).

    Raises
    ------
    InputError
        Fewer bytes than its points need.
    """
    order = ">" if is_ros2 and raw[1] == 0 else "<"
    try:
        at = 16 + int(np.frombuffer(raw, f"{order}u4", 1, offset=12)[0])  # after the header and the name of its frame
        if is_ros2:
            at = 4 + -(-(at - 4) // 8) * 8  # the time that offsets count from is a multiple of eight off the start
        count = int(np.frombuffer(raw, f"{order}u4", 1, offset=at + 16)[0])  # after that time, sizes and reserved bytes
    except ValueError:
        count, at = 1, len(raw)
    stride = stride_of(is_ros2)
    start, needed = at + 20, max(count - 1, 0) * stride + (LENGTH if count else 0)
    if len(raw) < start + needed:
        raise InputError(f"{where} is cut short: {len(raw)} bytes for {count} points; record or export it again")
    names, kinds = zip(*_POINT, ("line", "u1"), strict=True)
    offsets = [0, 4, 8, 12, 16, 17, 18]
    layout = np.dtype(
        {"names": names, "formats": [order + kind for kind in kinds], "offsets": offsets, "itemsize": stride}
    )
    padded = bytes(raw[start : start + needed]) + bytes(stride - LENGTH if count else 0)
    rows = np.frombuffer(padded, layout, count)
    return {name: rows[name] for name in names if name != "tag"}


def stride_of(is_ros2: bool) -> int:
    """Return the bytes from a point to the next."""
    return 20 if is_ros2 else LENGTH
