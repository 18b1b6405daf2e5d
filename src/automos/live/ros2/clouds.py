"""PointCloud2 with a field more, or with fewer points: on bytes, for messages of whoever decoded them."""

from __future__ import annotations

import array
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.scan import Scan
from automos.readers.columns import to_scan
from automos.readers.point_cloud2 import read_columns

FIELD = "moving"
STATIC, MOVING, UNKNOWN = 0, 1, 2
"""What the field says: a point that is not known may come to move, or has no return."""
_UINT8 = 2


class Body(NamedTuple):
    """What of a PointCloud2 changes with its points."""

    height: int
    width: int
    point_step: int
    row_step: int
    data: array.array[int]


def scan_of(message: Any, name: str) -> Scan:
    """Return the scan that a PointCloud2 holds, stamped by its header; InputError where it holds none."""
    stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
    return to_scan(read_columns(message, name), name, name, stamp)  # type: ignore[arg-type]


def with_field(message: Any, labels: npt.NDArray) -> Body:
    """Return the points of `message` with one byte more each: `STATIC`, `MOVING` or `UNKNOWN`.

    labels : (N,) of `Label`, in the message's order, which is kept; so are rows and columns.
    """
    rows = _rows(message)
    wider = np.empty((len(rows), rows.shape[1] + 1), np.uint8)
    wider[:, :-1] = rows
    wider[:, -1] = np.select([labels == Label.MOVING, labels == Label.STATIC], [MOVING, STATIC], UNKNOWN)
    return _body(wider, message.height, message.width)


def with_rows(message: Any, kept: npt.NDArray[np.bool_]) -> Body:
    """Return those points of `message` that are `kept` (N,), as one row."""
    rows = _rows(message)[kept]
    return _body(rows, 1, len(rows))


def new_field(message: Any, make: Any) -> Any:
    """Return the description of the field that `with_field` adds; `make` is the class of such."""
    return make(name=FIELD, offset=int(message.point_step), datatype=_UINT8, count=1)


def _rows(message: Any) -> npt.NDArray[np.uint8]:
    """Return (N, point_step) the bytes of each point, padding at the ends of rows left out."""
    height, width, step = int(message.height), int(message.width), int(message.point_step)
    row_step = width * step if height == 1 or not message.row_step else int(message.row_step)
    data = np.frombuffer(message.data, np.uint8)
    if height * width == 0:
        return np.zeros((0, step), np.uint8)
    return np.ndarray((height, width, step), np.uint8, data, 0, (row_step, step, 1)).reshape(-1, step)


def _body(rows: npt.NDArray[np.uint8], height: int, width: int) -> Body:
    data = array.array("B")  # which messages take as it is: of NumPy's arrays they check every byte
    data.frombytes(np.ascontiguousarray(rows).reshape(-1).data)
    return Body(int(height), int(width), rows.shape[1], int(width) * rows.shape[1], data)
