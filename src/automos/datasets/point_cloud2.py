"""ROS's sensor_msgs/PointCloud2: points of any fields, packed as their driver liked.

Rows may be padded, fields may lie anywhere in a point and in either byte order. Organised clouds come out row by row,
points without a return (zero or NaN) included.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from automos.datasets.columns import Columns
from automos.errors import InputError

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def read_columns(message: Any, where: str) -> Columns:
    """Return the columns of one message, each (N,), height times width points in the message's order.

    Parameters
    ----------
    message : with the fields of sensor_msgs/PointCloud2, whoever decoded it; `data` is (bytes,) uint8.
    where : names the message in what is raised.

    Raises
    ------
    InputError
        Fewer bytes than its points need, or fields that reach beyond a point.
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
    for field in message.fields:
        if field.count > 1 or field.name in columns:
            continue
        if field.datatype not in _TYPES:
            raise InputError(f"{where} has a field {field.name!r} of unknown type {field.datatype}")
        dtype = np.dtype(order + _TYPES[field.datatype])
        if field.offset + dtype.itemsize > point_step:
            raise InputError(
                f"{where} has a field {field.name!r} at byte {field.offset} of points of {point_step} bytes"
            )
        if height * width == 0:
            columns[field.name] = np.zeros(0, dtype)
            continue
        column = np.ndarray((height, width), dtype, data, field.offset, (row_step, point_step))
        columns[field.name] = column.reshape(-1)
    return columns
