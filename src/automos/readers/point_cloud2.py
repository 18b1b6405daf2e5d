"""ROS's sensor_msgs/PointCloud2: points of any fields, packed as their driver liked.

Rows may be padded, fields may lie anywhere in a point and in either byte order. Organised clouds come out row by row,
points without a return (zero or NaN) included.
"""

import struct
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import Mask
from automos.readers.columns import Columns
from automos.readers.records import require_bytes
from automos.readers.wire import Wire

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}

EMPTY = -1
"""The digest of clouds without points, which are not each other's repeats."""


def points_counted(raw: bytes, is_ros2: bool) -> int:
    """Return how many points a cloud as it lies in a bag says that it has, 0 if it is cut; its data may hold more."""
    with suppress(struct.error):
        here = Wire.behind_header(raw, is_ros2)
        return here.number() * here.number()
    return 0


def cloud_digest(raw: bytes, is_ros2: bool) -> int:
    """Return a number that clouds as they lie in a bag share, if they hold the same whatever their time; EMPTY if none.

    All of it is digested: half of an organised cloud may be the same in every message, where the beams meet nothing.
    """
    return zlib.crc32(raw[12:]) if points_counted(raw, is_ros2) else EMPTY


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
    cells = cells_of(message, where)
    point_step = cells.shape[2]
    order = ">" if message.is_bigendian else "<"
    columns: Columns = {}
    spans: list[tuple[int, int, str]] = []
    for field in message.fields:
        if field.count > 1:
            continue
        if field.datatype not in _TYPES:
            if field.name not in ("x", "y", "z"):
                continue  # there is no telling what it is
            raise InputError(f"{where} has a field {field.name!r} of unknown type {field.datatype}")
        dtype = np.dtype(order + _TYPES[field.datatype])
        if field.offset + dtype.itemsize > point_step:
            raise InputError(
                f"{where} has a field {field.name!r} at byte {field.offset} of points of {point_step} bytes"
            )
        begin, end = field.offset, field.offset + dtype.itemsize
        spans.append((begin, end, field.name))
        columns.setdefault(field.name, cells[..., begin:end].view(dtype).reshape(-1))
    _require_apart(spans, where)
    return columns


def with_rows(message: Any, kept: Mask) -> Any:
    """Return `message` with those of its N points that are `kept` (N,), in one row.

    Raises
    ------
    InputError
        It has not N points, or fewer bytes than its points need.
    """
    cells = cells_of(message, "a message")
    if cells.shape[0] * cells.shape[1] != len(kept):
        raise InputError(f"a message has {cells.shape[0]} x {cells.shape[1]} points, and {len(kept)} labels")
    rows = cells.reshape(-1, cells.shape[2])[kept].reshape(-1)
    return replace(message, height=1, width=int(kept.sum()), row_step=len(rows), data=rows)


def cells_of(message: Any, where: str) -> npt.NDArray[np.uint8]:
    """Return (height, width, point_step) the bytes of each point, padding at the ends of rows left out.

    Raises
    ------
    InputError
        The message, which `where` names, has fewer bytes.
    """
    step, data = int(message.point_step), np.frombuffer(message.data, np.uint8)
    height, width, row_step = _shape_of(int(message.height), int(message.width), step, int(message.row_step), data)
    needed = (height - 1) * row_step + width * step if height * width else 0
    require_bytes(where, len(data), needed, f"{height} x {width} points of {step} bytes")
    if not needed:
        return np.zeros((height, width, step), np.uint8)
    return np.ndarray((height, width, step), np.uint8, data, 0, (row_step, step, 1))


def _shape_of(height: int, width: int, step: int, row_step: int, data: npt.NDArray[np.uint8]) -> tuple[int, int, int]:
    """Return the rows, the points in one, and the bytes from one to the next that hold all points in `data`.

    Some drivers count too few points, or give the bytes of a row wrong where there is no padding. Bytes that a header
    does not count are points where they are whole ones, and not all zero, which is what padding and buffers hold.
    """
    if height <= 1 or row_step < width * step or len(data) == height * width * step:
        row_step = width * step
    if step <= 0:
        return height, width, row_step
    if height > 1 and row_step % step == 0 and len(data) == height * row_step:
        width = row_step // step if data.reshape(height, row_step)[:, width * step :].any() else width
    rest = data[height * row_step :]
    if row_step == width * step and len(rest) >= step and len(rest) % step == 0 and rest.any():
        return 1, len(data) // step, len(data)
    return height, width, row_step


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


def packed_rows(columns: Columns) -> npt.NDArray:
    """Return (N,) structured rows of little-endian columns, without gaps."""
    dtype = np.dtype([(name, column.dtype.newbyteorder("<")) for name, column in columns.items()])
    rows = np.empty(len(columns["x"]), dtype)
    for name, column in columns.items():
        rows[name] = column
    return rows


def cloud_message(types: Mapping[str, Any], columns: Columns, header: Any) -> Any:
    """Return a message of `columns`, all (N,), in the classes `types` of rosbags; `time` is `t`, in nanoseconds."""
    rows = packed_rows({"t" if name == "time" else name: _counted(name, c) for name, c in columns.items()})
    make_field = types["sensor_msgs/msg/PointField"]
    number_of = {kind: number for number, kind in _TYPES.items()}
    fields = [
        make_field(name, about[1], number_of[about[0].str[1:]], 1)
        for name, about in rows.dtype.fields.items()  # type: ignore[union-attr]
    ]
    return types["sensor_msgs/msg/PointCloud2"](
        header=header,
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=False,
        point_step=rows.dtype.itemsize,
        row_step=rows.nbytes,
        data=rows.view(np.uint8).reshape(-1),
        is_dense=bool(all(np.isfinite(columns[axis]).all() for axis in "xyz")),
    )


def _counted(name: str, column: npt.NDArray) -> npt.NDArray:
    """Return times as (N,) uint32 nanoseconds from the first on; negative ones and NaN (0) are possible."""
    if name != "time":
        return column
    start = np.fmin.reduce(column, initial=0.0)
    return np.round(1e9 * np.nan_to_num(column - np.float64(start), posinf=0.0)).astype(np.uint32)
