"""Polygon files: a text header, then the points as text or as packed numbers of either byte order.

Only the element `vertex` is read. What comes before and behind it (faces, cameras) is skipped, but must end where the
file does: else bytes were lost or came in, and all points behind them are others.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import read_bytes
from automos.readers.columns import MAX_FIELDS, Columns
from automos.readers.records import parse_points, require_bytes

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
}  # fmt: skip
_TYPES |= {np.dtype(kind).name: kind for kind in _TYPES.values()}  # int8, float32
_END = re.compile(rb"^[ \t]*end_header[ \t\r]*(\n|\Z)", re.M)
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}


@dataclass
class _Element:
    name: str
    count: int
    fields: dict[str, str] = field(default_factory=dict)
    counters: dict[str, int] = field(default_factory=dict)
    """Of the fields that are lists, the bytes of what counts their entries."""

    def dtype(self, order: str) -> np.dtype:
        return np.dtype([(name, order + kind) for name, kind in self.fields.items()])


def read(path: Path) -> Columns:
    """Return the columns of the file's vertices."""
    raw = read_bytes(path)
    encoding, elements, start = _parse_header(raw, path)
    before, vertex, after = _around_vertex(elements, path)
    if encoding == "ascii":
        return _from_text(raw[start:], before, vertex, after, path)
    order = _ORDERS[encoding]
    dtype = vertex.dtype(order)
    for element in before:
        start = _behind(element, order, raw, start)
    end = start + vertex.count * dtype.itemsize
    for element in after:
        end = _behind(element, order, raw, end)
    require_bytes(path, len(raw), end, f"{vertex.count} points")
    points = np.frombuffer(raw, dtype, vertex.count, offset=start)
    if raw[end:].strip(b"\0 \t\r\n"):
        raise InputError(
            f"{path} holds {len(raw) - end} bytes more than its header promises; bytes came in before the last points, "
            "or it was copied as text: copy it again"
        )
    return {name: points[name] for name in vertex.fields}


def _parse_header(raw: bytes, path: Path) -> tuple[str, list[_Element], int]:
    """Return the encoding, the elements in order, and the byte at which they start."""
    encoding = ""
    elements: list[_Element] = []
    if not raw.startswith(b"ply"):
        raise InputError(f"{path} is not a PLY file: it does not start with 'ply'")
    if (end := _END.search(raw)) is None:
        raise InputError(f"{path} is not a whole PLY file: its header has no end_header line")
    for line in raw[: end.start()].decode("ascii", "replace").split("\n"):
        words = line.split()
        try:
            match words:
                case ["format", name, *_]:
                    encoding = name
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                    if int(count) < 0:
                        raise ValueError("fewer elements than none")
                case ["property", kind, name] | ["property", "list", _, kind, name] if name not in elements[-1].fields:
                    elements[-1].fields[name] = _TYPES[kind]
                    if words[1] == "list":
                        elements[-1].counters[name] = int(_TYPES[words[2]].lstrip("iu"))  # no other counts
                    if len(elements[-1].fields) > MAX_FIELDS:
                        raise ValueError("more properties than any point has")
                case ["ply" | "comment" | "obj_info", *_] | []:
                    pass
                case _:
                    raise ValueError("no keyword, or a property that is malformed or named twice")
        except (KeyError, ValueError, IndexError):
            raise InputError(f"{path} has a PLY header line that cannot be understood: {line.strip()!r}") from None
    if encoding not in _ORDERS:
        raise InputError(f"{path} has PLY format {encoding!r}; known are {', '.join(_ORDERS)}")
    return encoding, elements, end.end()


def _around_vertex(elements: list[_Element], path: Path) -> tuple[list[_Element], _Element, list[_Element]]:
    """Return the elements before the vertices, these, and those behind them."""
    at = next((i for i, element in enumerate(elements) if element.name == "vertex"), None)
    if at is None:
        raise InputError(f"{path} has no element 'vertex'; a point cloud keeps its points there")
    if elements[at].counters:
        raise InputError(f"{path} has lists in its vertices; save it as a plain point cloud")
    return elements[:at], elements[at], elements[at + 1 :]


def _behind(element: _Element, order: str, raw: bytes, at: int) -> int:
    """Return the byte of `raw` behind an element that begins at byte `at`; one beyond its end where that is cut."""
    if not element.counters:
        return at + element.count * element.dtype(order).itemsize
    fields = [(np.dtype(kind).itemsize, element.counters.get(name, 0)) for name, kind in element.fields.items()]
    for _ in range(element.count):
        for width, counter in fields:
            length = int.from_bytes(raw[at : at + counter], "big" if order == ">" else "little") if counter else 1
            at += counter + length * width
        if at > len(raw):
            break
    return at


def _from_text(body: bytes, before: list[_Element], vertex: _Element, after: list[_Element], path: Path) -> Columns:
    """Return the columns of vertices that are text, every element a line."""
    n_before, n_after = (sum(element.count for element in elements) for elements in (before, after))
    matrix = parse_points(path, body, len(vertex.fields), n_before, vertex.count, not after)
    promised = n_before + vertex.count + n_after
    n_lines = sum(map(bool, map(bytes.strip, body.split(b"\n")))) if after else promised
    if n_lines != promised:
        raise InputError(f"{path} holds {n_lines} lines, its header promises {promised}; it is damaged: copy it again")
    return {name: matrix[:, i] for i, name in enumerate(vertex.fields)}
