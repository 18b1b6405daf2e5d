"""Foxglove's PointCloud, packed by Protocol Buffers, as JSON or as a message of ROS: little-endian points, no rows.

Its few fields are taken apart here as they are on the wire, by the numbers that its definition gives them, so that
none need come with the file. Points are in the sensor's frame: where that sits (`pose`) is told beside them.
"""

import base64
from collections.abc import Iterator
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np

from automos.core.reading import parse_json
from automos.readers import point_cloud2
from automos.readers.columns import Columns
from automos.readers.time_order import seconds_of
from automos.readers.wire import Wire

OWN, ROS = "foxglove.PointCloud", "foxglove_msgs/msg/PointCloud"
_TIME, _FRAME, _STEP, _FIELD, _DATA = 1, 2, 4, 5, 6
"""Numbers of the fields of a cloud."""
_KINDS = ("UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64")
_DATATYPES = (0, 2, 1, 4, 3, 6, 5, 7, 8)
"""What PointCloud2 calls the types that are counted from 0 (unknown), 1 (UINT8) on here."""


def head(raw: bytes, encoding: str) -> tuple[float, str]:
    """Return the stamp (s) and the frame of a cloud; of Protocol Buffers' and ROS's, the beginning suffices."""
    if encoding == "json":
        message = parse_json(raw)
        time, frame = message.get("timestamp") or {}, str(message.get("frame_id", ""))
        if isinstance(time, str):  # as Protocol Buffers write theirs
            return seconds_of(time.removesuffix("Z")), frame
        return time.get("sec", 0) + 1e-9 * time.get("nsec", time.get("nanosec", 0)), frame
    if encoding != "protobuf":
        return _behind_start(raw, encoding).header()
    message = _whole_fields(raw)
    time = _whole_fields(message.get(_TIME, b""))
    return time.get(1, 0) + 1e-9 * time.get(2, 0), bytes(message.get(_FRAME, b"")).decode(errors="replace")


def read_columns(raw: bytes, encoding: str, where: str) -> Columns:
    """Return the columns of one cloud, each (N,); `where` names it in errors, which are those of PointCloud2."""
    if encoding == "json":
        message = parse_json(raw)
        step, data = message["point_stride"], base64.b64decode(message["data"])
        fields = [(field["name"], field["offset"], field["type"]) for field in message["fields"]]
    elif encoding == "protobuf":
        step, data, fields = _from_wire(raw)
    else:
        step, data, fields = _from_ros(raw, encoding)
    cloud = SimpleNamespace(
        height=1,
        width=len(data) // step if step else 0,
        point_step=step,
        row_step=0,
        is_bigendian=False,
        fields=[SimpleNamespace(name=name, offset=at, datatype=_datatype(kind), count=1) for name, at, kind in fields],
        data=np.frombuffer(data, np.uint8),
    )
    return point_cloud2.read_columns(cloud, where)


def _datatype(kind: int | str) -> int:
    number = kind if isinstance(kind, int) else _KINDS.index(kind) + 1 if kind in _KINDS else 0
    return _DATATYPES[number] if 0 <= number < len(_DATATYPES) else 0


def _from_wire(raw: bytes) -> tuple[int, bytes, list[tuple[str, int, int]]]:
    message, told = dict[int, Any](), []
    for number, value in _fields(raw):  # kept one by one: a hostile message holds millions
        message[number] = value
        if number == _FIELD:
            field = dict(_fields(value))
            told.append((bytes(field.get(1, b"")).decode(), field.get(2, 0), field.get(3, 0)))
    return message.get(_STEP, 0), bytes(message.get(_DATA, b"")), told


def _whole_fields(raw: Any) -> dict[int, Any]:
    """Return the fields that are whole in a message of Protocol Buffers, or in its beginning."""
    found: dict[int, Any] = {}
    with suppress(ValueError, IndexError):
        found.update(_fields(raw))
    return found


def _fields(raw: Any) -> Iterator[tuple[int, Any]]:
    """Yield number and value (whole number, or bytes) of each field of a message of Protocol Buffers."""
    raw, at = memoryview(raw), 0
    while at < len(raw):
        key, at = _varint(raw, at)
        match key & 7:
            case 0:
                value, at = _varint(raw, at)
            case 1 | 5 as width:
                size = 8 if width == 1 else 4
                value, at = int.from_bytes(raw[at : at + size], "little"), at + size
            case 2:
                n, at = _varint(raw, at)
                value, at = raw[at : at + n], at + n
            case other:
                raise ValueError(f"a field of a kind ({other}) that Protocol Buffers do not have")
        if at > len(raw):
            raise ValueError("it ends within a field")
        yield key >> 3, value


def _varint(raw: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for k in range(10):
        value |= (raw[at + k] & 127) << 7 * k
        if raw[at + k] < 128:
            return value, at + k + 1
    raise ValueError("a number without end")


def _from_ros(raw: bytes, encoding: str) -> tuple[int, bytes, list[tuple[str, int, int]]]:
    """Take apart ROS's message."""
    here = _behind_start(raw, encoding)
    here.header()
    here.align(8)
    here.take(7 * 8)  # where the sensor is in it
    step, n_fields = here.number(), here.number()
    fields = [(here.text().rstrip(b"\0").decode(), here.number(), here.take(1)[0]) for _ in range(n_fields)]
    return step, here.text(), fields


def _behind_start(raw: bytes, encoding: str) -> Wire:
    """Return the place where a message of ROS begins that has no header: of ROS 2 behind what says its encoding."""
    is_ros2 = encoding == "cdr"
    return Wire(raw, is_ros2, 4 if is_ros2 else 0)
