"""What a bag holds: files of topics, and messages with the points of a LiDAR, of which types, with which columns.

The definitions of these types are known and have not changed, so those that a bag carries along are not needed: some
recorders leave them empty, or write a name in their place. Nor are they to leave points out: decoding and encoding a
message may change what no field says, so only the rows are cut, and the numbers that count them.
"""

import re
import struct
import zlib
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.scan import Mask
from automos.readers import foxglove_cloud, livox_message
from automos.readers.columns import Columns
from automos.readers.packets.messages import TYPES as PACKETS
from automos.readers.point_cloud2 import cloud_digest, header_frame, header_stamp, read_columns, shape_of
from automos.readers.wire import Wire

LARGEST = 1 << 30
"""Bytes of a message, or of the chunk it is in, at most; the clouds of any sensor have a hundredth of that."""


class Topic(NamedTuple):
    """A topic's name, the type of its messages (sensor_msgs/msg/PointCloud2), and how they are packed (cdr, ros1)."""

    name: str
    kind: str
    encoding: str


def type_name(name: str) -> str:
    """Return the name of a message type as ROS 2 writes it: ROS 1 says sensor_msgs/PointCloud2."""
    package, _, kind = name.rpartition("/")
    return f"{package}/msg/{kind}" if package and not package.endswith("/msg") else name


CLOUD = "sensor_msgs/msg/PointCloud2"
_OLD_CLOUD = "sensor_msgs/msg/PointCloud"
TREES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
"""Types of what says where frames are."""
_OF_ROS = {CLOUD, _OLD_CLOUD, *PACKETS, *livox_message.TYPES, foxglove_cloud.ROS}
_HEAD = 4096
"""Bytes of a message that hold its header and the name of its frame."""
_RAW = r"(hesai|pandar|rslidar|robosense|ouster|seyond|lslidar)\w*/.*(packet|scan|frame)|.*/Compressed\w*Cloud"
"""Packets of drivers, and clouds that only their own library unpacks."""


def is_of_points(topic: Topic) -> bool:
    """Return whether the messages of a topic hold points that are read here."""
    if topic.kind == foxglove_cloud.OWN:
        return topic.encoding in ("protobuf", "json")
    return topic.kind in _OF_ROS and topic.encoding in ("cdr", "ros1")


def is_raw(topic: Topic) -> bool:
    """Return whether a topic holds what points can be made of, by other programs: packets, or compressed clouds."""
    return re.match(_RAW, topic.kind, re.I) is not None


def head_size(topic: Topic) -> int:
    """Return how many bytes of a message of `topic` say when it was measured, and in which frame."""
    return LARGEST if topic.encoding == "json" else _HEAD


def head(raw: bytes, topic: Topic) -> tuple[float, str]:
    """Return the stamp (s) and the frame in the header of a message, of which the beginning suffices."""
    if topic.kind in (foxglove_cloud.OWN, foxglove_cloud.ROS):
        return foxglove_cloud.head(raw, topic.encoding)
    is_ros2 = topic.encoding == "cdr"
    return header_stamp(raw, is_ros2), header_frame(raw, is_ros2)


def digest(raw: bytes, topic: Topic) -> int:
    """Return a number that messages share if they hold the same points, whatever their time; EMPTY if none."""
    if topic.kind == CLOUD:
        return cloud_digest(raw, topic.encoding == "cdr")
    return zlib.crc32(raw[len(raw) // 2 :])


def read_message(raw: bytes, topic: Topic, where: str) -> Columns:
    """Return the columns of a message of points, each (N,), in its order; `where` names it in errors.

    Raises
    ------
    InputError
        The message does not hold what its header promises.
    """
    is_ros2 = topic.encoding == "cdr"
    if topic.kind in livox_message.TYPES:
        return livox_message.read_columns(raw, is_ros2, where)
    if topic.kind in (foxglove_cloud.OWN, foxglove_cloud.ROS):
        return foxglove_cloud.read_columns(raw, topic.encoding, where)
    message = decoded(raw, topic)
    if topic.kind == _OLD_CLOUD:
        axes = {axis: np.array([getattr(point, axis) for point in message.points], np.float32) for axis in "xyz"}
        return axes | {channel.name: channel.values for channel in message.channels}
    return read_columns(message, where)


def decoded(raw: bytes, topic: Topic) -> Any:
    """Return a message of ROS by its well-known definition."""
    types = _types(topic.encoding == "cdr")
    return (types.deserialize_cdr if topic.encoding == "cdr" else types.deserialize_ros1)(raw, topic.kind)


@cache
def _types(is_ros2: bool) -> Any:
    typesys = import_extra("rosbags.typesys", "ros")
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE if is_ros2 else typesys.Stores.ROS1_NOETIC)
    for tree in TREES:  # that of ROS 1 knows none of them
        if tree not in types.types:
            types.register(typesys.get_types_from_msg("geometry_msgs/TransformStamped[] transforms", tree))
    return types


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
    cut = livox_message.with_rows if kind in livox_message.TYPES else _cloud_with_rows
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
