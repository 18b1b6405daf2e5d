"""The message of Livox's own drivers, CustomMsg: points one after the other with their time, line and tag.

Drivers for ROS 1 and ROS 2 give it the same fields under different package names. It is taken apart here, as it is on
the wire: decoding a hundred thousand points as messages of their own takes seconds a scan.
"""

import struct

import numpy as np

from automos.core.errors import InputError
from automos.readers.columns import Columns
from automos.readers.wire import Wire

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
    try:
        here = Wire.behind_header(bytes(raw), is_ros2)
        here.align(8)
        here.take(16)  # the time that offsets count from, sizes, the sensor's number and reserved bytes
        count, at = here.number(), here.at
    except struct.error:
        count, at = 1, len(raw)
    stride = stride_of(is_ros2)
    start, needed = at, max(count - 1, 0) * stride + (LENGTH if count else 0)
    if len(raw) < start + needed:
        raise InputError(f"{where} is cut short: {len(raw)} bytes for {count} points; record or export it again")
    names, kinds = zip(*_POINT, ("line", "u1"), strict=True)
    offsets = [0, 4, 8, 12, 16, 17, 18]
    layout = np.dtype(
        {"names": names, "formats": [here.order + kind for kind in kinds], "offsets": offsets, "itemsize": stride}
    )
    padded = bytes(raw[start : start + needed]) + bytes(stride - LENGTH if count else 0)
    rows = np.frombuffer(padded, layout, count)
    return {name: rows[name] for name in names if name != "tag"}


def stride_of(is_ros2: bool) -> int:
    """Return the bytes from a point to the next."""
    return 20 if is_ros2 else LENGTH
