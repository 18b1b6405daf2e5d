"""Messages of points as they lie in a bag, with some of their points left out and every other byte kept.

Decoding and encoding a message needs its definition and may change what no field says (padding, the order of bytes);
here only the rows are cut, and the numbers that count them.
"""

import struct

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.readers import livox_message
from automos.readers.bag_messages import CLOUD
from automos.readers.point_cloud2 import shape_of
from automos.readers.wire import Wire

Mask = npt.NDArray[np.bool_]

TYPES = (CLOUD, *livox_message.TYPES)
"""Types of messages that are cut."""


def with_rows(raw: bytes | memoryview, kind: str, is_ros2: bool, kept: Mask) -> bytes:
    """Return message `raw` of type `kind`, one of `TYPES`, with those points that are `kept`.

    kept : (N,) bool, in the message's order. Organised clouds become one row.

    Raises
    ------
    InputError
        The message has not N points, or fewer bytes than its points need.
    """
    cut = _livox_with_rows if kind in livox_message.TYPES else _cloud_with_rows
    try:
        return cut(bytes(raw), is_ros2, kept)
    except struct.error:
        raise InputError(f"a message of {len(raw)} bytes is cut short; record or export the bag again") from None


def _cloud_with_rows(raw: bytes, is_ros2: bool, kept: Mask) -> bytes:
    here = Wire.behind_header(raw, is_ros2)
    here.align(4)
    start = here.at
    height, width = here.number(), here.number()
    fields = here.at
    for _ in range(here.number()):
        here.text()
        here.number()  # its offset
        here.at += 1  # its type
        here.number()  # how many there are of it
    here.at += 1  # the order of bytes
    point_step = here.number()
    steps = here.at
    row_step, n_bytes = here.number(), here.number()
    data = here.at
    cells = np.frombuffer(raw, np.uint8)[data : data + n_bytes]
    height, width, row_step = shape_of(height, width, point_step, row_step, cells)
    needed = (height - 1) * row_step + width * point_step if height * width else 0
    if height * width != len(kept) or n_bytes < needed or len(raw) < data + n_bytes:
        raise InputError(f"a message of {height} x {width} points has {n_bytes} bytes of them, and {len(kept)} labels")
    points = np.ndarray((height, width, point_step), np.uint8, cells, 0, (row_step, point_step, 1)) if needed else None
    rows = b"" if points is None else points.reshape(-1, point_step)[kept].tobytes()
    head = raw[:start] + here.packed(1, int(kept.sum())) + raw[fields:steps]
    return head + here.packed(len(rows), len(rows)) + rows + raw[data + n_bytes :]


def _livox_with_rows(raw: bytes, is_ros2: bool, kept: Mask) -> bytes:
    here = Wire.behind_header(raw, is_ros2)
    here.align(8)
    here.at += 8  # the time that the points' own count from
    counted = here.at
    here.number()
    here.at += 4  # the number of the sensor, reserved bytes
    listed = here.at
    count = here.number()
    stride, length = livox_message.stride_of(is_ros2), livox_message.LENGTH
    end = here.at + max(count - 1, 0) * stride + (length if count else 0)
    if count != len(kept) or len(raw) < end:
        raise InputError(f"a message of {count} points has {len(raw) - here.at} bytes of them, and {len(kept)} labels")
    padded = raw[here.at : end] + bytes(stride - length if count else 0)
    rows = np.frombuffer(padded, np.uint8).reshape(-1, stride)[kept].tobytes()
    rows = rows[: len(rows) - (stride - length)] if rows else rows  # nothing fills up behind the last
    n = here.packed(int(kept.sum()))
    return raw[:counted] + n + raw[counted + 4 : listed] + n + rows + raw[end:]
