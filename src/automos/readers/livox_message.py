"""The message of Livox's own drivers, CustomMsg: points one after the other with their time, line and tag.

Drivers for ROS 1 and ROS 2 give it the same fields under different package names. It is taken apart here, as it is on
the wire: decoding a hundred thousand points as messages of their own takes seconds a scan.
"""

import struct
from contextlib import suppress

import numpy as np

from automos.core.arrays import Mask
from automos.core.errors import InputError
from automos.readers.columns import Columns
from automos.readers.records import require_bytes
from automos.readers.wire import Wire

TYPES = tuple(f"{package}/msg/CustomMsg" for package in ("livox_ros_driver", "livox_ros_driver2", "livox_interfaces"))

_POINT = np.dtype([
    ("offset_time", "u4"), ("x", "f4"), ("y", "f4"), ("z", "f4"), ("reflectivity", "u1"), ("tag", "u1"), ("line", "u1"),
])  # fmt: skip
LENGTH = _POINT.itemsize
"""Bytes of a point. CDR, of ROS 2, starts each at a multiple of four."""


def read_columns(raw: bytes | memoryview, is_ros2: bool, where: str) -> Columns:
    """Return the columns of one message as it lies in a bag: x, y, z, reflectivity, line, offset_time (ns), each (N,).

    Raises
    ------
    InputError
        Fewer bytes than its points need.
    """
    here, count, _ = _points(raw, is_ros2, where)
    rows = np.ndarray(count, _POINT.newbyteorder(here.order), raw, here.at, (_stride(is_ros2),))
    return {name: rows[name] for name in _POINT.names or () if name != "tag"}


def with_rows(raw: bytes, is_ros2: bool, kept: Mask) -> bytes:
    """Return message `raw` with those of its N points that are `kept` (N,); errors are those of `read_columns`."""
    here, count, end = _points(raw, is_ros2, "a message")
    if count != len(kept):
        raise InputError(f"a message has {count} points, and {len(kept)} labels")
    stride, gap = _stride(is_ros2), _stride(is_ros2) - LENGTH
    padded = raw[here.at : end] + bytes(gap if count else 0)
    rows = np.frombuffer(padded, np.uint8).reshape(-1, stride)[kept].tobytes()
    n = here.packed(int(kept.sum()))  # told twice, before four other bytes and right before the points
    head = raw[: here.at - 12] + n + raw[here.at - 8 : here.at - 4] + n
    return head + rows[: max(len(rows) - gap, 0)] + raw[end:]  # nothing fills up behind the last


def _points(raw: bytes | memoryview, is_ros2: bool, where: str) -> tuple[Wire, int, int]:
    """Return the place where a message's points begin, how many it counts, and the byte at which they end."""
    count, end = 1, len(raw) + 1
    with suppress(struct.error):  # cut within its header
        here = Wire.behind_header(bytes(raw), is_ros2)
        here.align(8)
        here.take(16)  # the time that offsets count from, sizes, the sensor's number and reserved bytes
        count = here.number()
        end = here.at + (max(count - 1, 0) * _stride(is_ros2) + LENGTH if count else 0)
    require_bytes(where, len(raw), end, f"{count} points")
    return here, count, end


def _stride(is_ros2: bool) -> int:
    """Return the bytes from a point to the next."""
    return 20 if is_ros2 else LENGTH
