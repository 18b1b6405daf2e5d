"""Polygon files: a text header, then the points as text or as packed numbers of either byte order.

Only the element `vertex` is read. What follows it (faces, cameras) is skipped; what comes before has a fixed size.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from automos.datasets.columns import MAX_FIELDS, Columns
from automos.datasets.text import parse_points
from automos.errors import InputError
from automos.reading import read_bytes

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}


@dataclass
class _Element:
    name: str
    count: int
    fields: list[tuple[str, str]] = field(default_factory=list)
    has_list: bool = False


def read(path: Path) -> Columns:
    """Return the columns of the file's vertices."""
    raw = read_bytes(path)
    encoding, elements, start = _parse_header(raw, path)
    before, vertex = _until_vertex(elements, path)
    if encoding == "ascii":
        return _from_text(raw[start:], sum(element.count for element in before), vertex, path, elements[-1] is vertex)
    order = _ORDERS[encoding]
    skipped = sum(element.count * _dtype(element, order).itemsize for element in before)
    dtype = _dtype(vertex, order)
    promised = skipped + vertex.count * dtype.itemsize
    if len(raw) - start < promised:
        raise InputError(
            f"{path} is cut short: {len(raw) - start} bytes of points, its header promises {promised}; copy it again"
        )
    if elements[-1] is vertex and len(raw) - start - promised >= dtype.itemsize > 0:
        raise InputError(f"{path} holds more points than its header promises; its header is damaged: copy it again")
    points = np.frombuffer(raw, dtype, vertex.count, offset=start + skipped)
    return {name: points[name] for name, _ in vertex.fields}


def _parse_header(raw: bytes, path: Path) -> tuple[str, list[_Element], int]:
    """Return the encoding, the elements in order, and the byte at which they start."""
    encoding, start = "", 0
    elements: list[_Element] = []
    if not raw.startswith(b"ply"):
        raise InputError(f"{path} is not a PLY file: it does not start with 'ply'")
    while True:
        end = raw.find(b"\n", start)
        if end < 0:
            raise InputError(f"{path} is not a whole PLY file: its header has no end_header line")
        line = raw[start:end].decode("ascii", "replace").strip()
        start = end + 1
        words = line.split()
        try:
            match words:
                case ["end_header"]:
                    break
                case ["format", name, *_]:
                    encoding = name
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                    if int(count) < 0:
                        raise ValueError("fewer elements than none")
                case ["property", "list", *_]:
                    elements[-1].has_list = True
                case ["property", kind, name] if name not in dict(elements[-1].fields):
                    elements[-1].fields.append((name, _TYPES[kind]))
                    if len(elements[-1].fields) > MAX_FIELDS:
                        raise ValueError("more properties than any point has")
                case ["property", *_]:
                    raise ValueError("a property that is malformed or named twice")
        except (KeyError, ValueError, IndexError):
            raise InputError(f"{path} has a PLY header line that cannot be understood: {line!r}") from None
    if encoding not in _ORDERS:
        raise InputError(f"{path} has PLY format {encoding!r}; known are {', '.join(_ORDERS)}")
    return encoding, elements, start


def _until_vertex(elements: list[_Element], path: Path) -> tuple[list[_Element], _Element]:
    at = next((i for i, element in enumerate(elements) if element.name == "vertex"), None)
    if at is None:
        raise InputError(f"{path} has no element 'vertex'; a point cloud keeps its points there")
    if any(element.has_list for element in elements[: at + 1]):
        raise InputError(f"{path} has lists in or before its vertices; save it as a plain point cloud")
    return elements[:at], elements[at]


def _dtype(element: _Element, order: str) -> np.dtype:
    return np.dtype([(name, order + kind) for name, kind in element.fields])


def _from_text(body: bytes, n_skipped: int, vertex: _Element, path: Path, is_last: bool) -> Columns:
    matrix = parse_points(path, body, len(vertex.fields), n_skipped, vertex.count, is_last)
    return {name: matrix[:, i] for i, (name, _) in enumerate(vertex.fields)}
