"""What a bag holds: files of topics, and messages with the points of a LiDAR, of which types, with which columns.

The definitions of these types are known and have not changed, so those that a bag carries along are not needed: some
recorders leave them empty, or write a name in their place. Nor are they to leave points out: decoding and encoding a
message may change what no field says, so only the rows are cut, and the numbers that count them.
"""

import re
import zlib
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from automos.core.extras import import_extra
from automos.core.reading import damage_reported
from automos.core.scan import Mask
from automos.readers import foxglove_cloud, livox_message, point_cloud2
from automos.readers.columns import Columns
from automos.readers.packets.messages import TYPES as PACKETS
from automos.readers.point_cloud2 import cloud_digest, read_columns
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
    return Wire(raw.ljust(16, b"\0"), topic.encoding == "cdr").header()


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
    if kind in livox_message.TYPES:
        return livox_message.with_rows(bytes(raw), is_ros2, kept)
    what, types = f"a message of {len(raw)} bytes", _types(is_ros2)
    with damage_reported(what, "is cut short", "record or export the bag again", kinds=Exception):
        message = decoded(bytes(raw), Topic("", kind, "cdr" if is_ros2 else "ros1"))
    cut = point_cloud2.with_rows(message, kept)
    return bytes((types.serialize_cdr if is_ros2 else types.serialize_ros1)(cut, kind))
