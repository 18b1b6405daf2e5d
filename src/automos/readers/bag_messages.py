"""Messages that hold the points of a LiDAR: which types are read, what their headers say, and their columns.

The definitions of these types are known and have not changed, so those that a bag carries along are not needed: some
recorders leave them empty, or write a name in their place.
"""

from __future__ import annotations

import re
import zlib
from functools import cache
from typing import Any

from automos.readers import foxglove_cloud, livox_message, velodyne_message
from automos.readers.bag_file import LARGEST, Topic
from automos.readers.columns import Columns
from automos.readers.formats import import_extra
from automos.readers.point_cloud2 import cloud_digest, header_frame, header_stamp, read_columns
from automos.readers.velodyne_decoder import SweepDecoder

CLOUD = "sensor_msgs/msg/PointCloud2"
PACKETS = velodyne_message.TYPE
_TYPES = {CLOUD, PACKETS, *livox_message.TYPES, *foxglove_cloud.TYPES}
_HEAD = 4096
"""Bytes of a message that hold its header and the name of its frame; recorders that compress messages do not split."""
_DRIVERS = r"(hesai|pandar|rslidar|robosense|ouster|innovusion|seyond|lslidar|vanjee)\w*/.*(packet|scan|frame)"


def is_of_points(topic: Topic) -> bool:
    """Return whether the messages of a topic hold points that are read here."""
    return topic.kind in _TYPES and topic.encoding in ("cdr", "ros1", "protobuf", "json")


def is_of_packets(topic: Topic) -> bool:
    """Return whether a topic holds what a sensor sent, of a maker whose packets are not decoded here."""
    return re.match(_DRIVERS, topic.kind, re.I) is not None


def head_size(topic: Topic) -> int:
    """Return how many bytes of a message of `topic` say when it was measured, and in which frame."""
    return LARGEST if topic.encoding == "json" else _HEAD


def head(raw: bytes, topic: Topic) -> tuple[float, str]:
    """Return the stamp (s) and the frame in the header of a message, of which the beginning suffices."""
    if topic.kind in foxglove_cloud.TYPES:
        return foxglove_cloud.head(raw, topic.encoding)
    is_ros2 = topic.encoding == "cdr"
    return header_stamp(raw, is_ros2), header_frame(raw, is_ros2)


def digest(raw: bytes, topic: Topic) -> int:
    """Return a number that messages share if they hold the same points, whatever their time; EMPTY if none."""
    if topic.kind == CLOUD:
        return cloud_digest(raw, topic.encoding == "cdr")
    return zlib.crc32(raw[len(raw) // 2 :])


def read_message(raw: bytes, topic: Topic, where: str, decoder: SweepDecoder | None = None) -> Columns:
    """Return the columns of a message, each (N,), in its order; `where` names it in errors, `decoder` reads packets.

    Raises
    ------
    InputError
        The message does not hold what its header promises.
    """
    is_ros2 = topic.encoding == "cdr"
    if topic.kind == PACKETS and decoder is not None:
        return decoder.columns(velodyne_message.read_packets(raw, is_ros2, where))
    if topic.kind in livox_message.TYPES:
        return livox_message.read_columns(raw, is_ros2, where)
    if topic.kind in foxglove_cloud.TYPES:
        return foxglove_cloud.read_columns(raw, topic.encoding, where)
    return read_columns(decoded(raw, topic), where)


def decoded(raw: bytes, topic: Topic) -> Any:
    """Return a message of ROS by its well-known definition."""
    types = _types(topic.encoding == "cdr")
    return (types.deserialize_cdr if topic.encoding == "cdr" else types.deserialize_ros1)(raw, topic.kind)


@cache
def _types(is_ros2: bool) -> Any:
    typesys = import_extra("rosbags.typesys", "ros")
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE if is_ros2 else typesys.Stores.ROS1_NOETIC)
