"""ROS's sensor_msgs/PointCloud2: points of any fields, packed as their driver liked.

Rows may be padded, fields may lie anywhere in a point and in either byte order. Organised clouds come out row by row,
points without a return (zero or NaN) included.
"""

from __future__ import annotations

import zlib
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from automos.core.errors import InputError
from automos.readers.columns import Columns

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}

EMPTY = -1
"""The digest of clouds without points, which are not each other's repeats."""


def header_stamp(raw: bytes | memoryview, is_ros2: bool) -> float:
    """Return the seconds in a message's header, without decoding what follows."""
    big = is_ros2 and raw[1] == 0
    seconds, nanoseconds = np.frombuffer(raw, ">u4" if big else "<u4", 2, offset=4).tolist()
    return seconds + 1e-9 * nanoseconds


def cloud_digest(raw: bytes | memoryview, is_ros2: bool) -> int:
    """Return a number that clouds as they lie in a bag share, if they hold the same whatever their time; EMPTY if none.

    All of it is digested: half of an organised cloud may be the same in every message, where the beams meet nothing.
    """
    order: Literal["big", "little"] = "big" if is_ros2 and raw[1] == 0 else "little"
    at = 16 + int.from_bytes(raw[12:16], order)  # behind the name of the frame
    at += -at % 4 if is_ros2 else 0
    height, width = (int.from_bytes(raw[k : k + 4], order) for k in (at, at + 4))
    return zlib.crc32(raw[12:]) if height * width else EMPTY


def read_columns(message: Any, where: str) -> Columns:
    """Return the columns of one message, each (N,), height times width points in the message's order.

    Parameters
    ----------
    message : with the fields of sensor_msgs/PointCloud2, whoever decoded it; `data` is (bytes,) uint8.
    where : names the message in what is raised.

    Raises
    ------
    InputError
        Fewer bytes than its points need, fields that reach beyond a point, or two in the same place.
    """
    height, width = int(message.height), int(message.width)
    point_step, row_step = int(message.point_step), int(message.row_step)
    if height == 1 or row_step == 0:
        row_step = width * point_step  # drivers get it wrong where it does not matter
    n_bytes = (height - 1) * row_step + width * point_step if height * width else 0
    data = np.asarray(message.data).view(np.uint8)
    if len(data) < n_bytes or row_step < width * point_step:
        raise InputError(
            f"{where} is cut short: {len(data)} bytes for {height} x {width} points of {point_step} bytes; "
            "record or export it again"
        )
    order = ">" if message.is_bigendian else "<"
    columns: Columns = {}
    spans: list[tuple[int, int, str]] = []
    for field in message.fields:
        if field.count > 1:
            continue
        if field.datatype not in _TYPES:
            raise InputError(f"{where} has a field {field.name!r} of unknown type {field.datatype}")
        dtype = np.dtype(order + _TYPES[field.datatype])
        if field.offset + dtype.itemsize > point_step:
            raise InputError(
                f"{where} has a field {field.name!r} at byte {field.offset} of points of {point_step} bytes"
            )
        spans.append((field.offset, field.offset + dtype.itemsize, field.name))
        if height * width == 0:
            columns[field.name] = np.zeros(0, dtype)
            continue
        column = np.ndarray((height, width), dtype, data, field.offset, (row_step, point_step))
        columns.setdefault(field.name, column.reshape(-1))
    _require_apart(spans, where)
    return columns


def _require_apart(spans: list[tuple[int, int, str]], where: str) -> None:
    """Raise where x, y or z is there twice, or bytes belong to two fields: names of one colour may share theirs."""
    names = [name for _, _, name in spans]
    if max(names.count(axis) for axis in "xyz") > 1:
        raise InputError(f"{where} has x, y or z twice; record or export it again")
    for one, other in pairwise(sorted(spans)):
        is_one_place = one[:2] == other[:2] and not {one[2], other[2]} & {"x", "y", "z"}
        if other[0] < one[1] and not is_one_place:
            raise InputError(
                f"{where} has fields {one[2]!r} and {other[2]!r} in the same bytes; record or export it again"
            )
