"""Point Cloud Library files: a text header, then ascii, binary or binary_compressed points of any fields."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST, make_transform
from automos.core.reading import damage_reported, read_bytes
from automos.core.scan import Pose
from automos.readers.columns import MAX_FIELDS, Columns
from automos.readers.lzf import decompress
from automos.readers.records import columns_of_field, parse_points, require_bytes, require_in_place

_MAX_COUNT = 1 << 16
"""Values per point of one field; the largest histograms have hundreds."""
_KINDS = {"F": "f", "I": "i", "U": "u", "B": "u"}
_LONGEST_HEADER = 1 << 16
"""Bytes."""


@dataclass(frozen=True)
class Header:
    """What a PCD file says of itself.

    Attributes
    ----------
    dtype : one point; fields of COUNT > 1 are sub-arrays, padding fields ("_") carry their place in the name.
    n_points : WIDTH times HEIGHT.
    viewpoint : (4, 4) float64, VIEWPOINT as a transform: where the sensor was, in the frame of the writer's choice.
    encoding : "ascii", "binary" or "binary_compressed".
    start : byte at which the points start.
    """

    dtype: np.dtype
    n_points: int
    viewpoint: Pose
    encoding: str
    start: int

    @property
    def names(self) -> tuple[str, ...]:
        """Of the fields."""
        return self.dtype.names or ()


def read(path: Path) -> Columns:
    """Return the columns of one file; those of several values, other than places, and padding are left out."""
    raw = read_bytes(path)
    header = _parse_header(raw, path)
    body = raw[header.start :]
    if header.encoding == "ascii":
        return _from_text(body, header, path)
    if header.encoding == "binary":
        require_bytes(path, len(body), header.n_points * header.dtype.itemsize, f"{header.n_points} points")
        points = np.frombuffer(body, header.dtype, header.n_points)
        columns = _columns({name: points[name] for name in header.names})
        require_in_place(columns, body, len(body) - points.nbytes, path)
        return columns
    return _from_compressed(body, header, path)


def read_header(path: Path) -> Header:
    """Return the header of one file without reading its points."""
    with open(path, "rb") as file:
        return _parse_header(file.read(_LONGEST_HEADER), path)


def read_headers(paths: Sequence[Path]) -> tuple[Pose | None, list[str]]:
    """Return (N, 4, 4) the viewpoints of the files at `paths`, None where all are as if they had none; what to say.

    Some writers put w last: where only so the sensor stands upright, or is not turned by half a turn exactly where the
    frame begins or it stays, it is meant so. Bytes may lie behind the points; they are not read.
    """
    from scipy.spatial.transform import Rotation

    headers = [read_header(path) for path in paths]
    surplus = [(path.name, n) for path, header in zip(paths, headers, strict=True) if (n := _surplus(path, header)) > 0]
    behind = f"{len(surplus)} files hold bytes behind their points, which are not read"
    said = [f"{behind} (first: {name}, {n} bytes)." for name, n in surplus[:1]]
    T = np.stack([header.viewpoint for header in headers])
    first_to_last = np.roll(Rotation.from_matrix(T[:, :3, :3]).as_quat(), 1, axis=1)
    R, up = Rotation.from_quat(first_to_last).as_matrix(), T[:, 2, 2].min()
    is_there = ~T[:, :3, 3].any(axis=1) | (np.ptp(T[:, :3, 3], axis=0).max() == 0.0)
    is_half_turn = np.isclose(first_to_last[:, 3] ** 2, 1.0, rtol=0.0, atol=1e-12)
    if R[:, 2, 2].min() > (0.0 if (is_half_turn & is_there).any() else max(up, 0.0)):
        T[:, :3, :3] = R
        order = "VIEWPOINT has its quaternions as x y z w, as which they are read; the format has them as w x y z."
        said.append(f"{paths[0].parent}: {order}")
    return (None if np.allclose(T, np.eye(4)) else T), said


def _surplus(path: Path, header: Header) -> int:
    n_bytes = path.stat().st_size - header.start
    if header.encoding == "binary":
        return n_bytes - header.n_points * header.dtype.itemsize
    if header.encoding == "binary_compressed":
        with path.open("rb") as file:
            file.seek(header.start)
            return n_bytes - 8 - int.from_bytes(file.read(4), "little")
    return 0


# ------------------------------------------------------------------------------------------------------- header
def _parse_header(raw: bytes, path: Path) -> Header:
    entries: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in entries:
        end = raw.find(b"\n", start)
        if end < 0:
            raise InputError(f"{path} is not a whole PCD file: its header has no DATA line")
        words = raw[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            entries[words[0].upper()] = words[1:]
    try:
        return _interpret(entries, start)
    except (KeyError, ValueError, IndexError, TypeError, OverflowError, MemoryError) as error:
        raise InputError(f"{path} has a PCD header that cannot be understood: {error}") from None


def _interpret(entries: dict[str, list[str]], start: int) -> Header:
    names = entries["FIELDS"] if "FIELDS" in entries else entries["COLUMNS"]
    if len(names) > MAX_FIELDS:
        raise ValueError(f"{len(names)} fields")
    if max(names.count(axis) for axis in "xyz") > 1:
        raise ValueError("x, y or z is there twice")
    counts = [int(count) for count in entries.get("COUNT", ["1"] * len(names))]
    fields = []
    for i, (name, kind, size, count) in enumerate(zip(names, entries["TYPE"], entries["SIZE"], counts, strict=True)):
        label = f"_{i}" if name == "_" or name in names[:i] else name
        scalar = np.dtype(f"<{_KINDS[kind.upper()]}{int(size)}")
        if not 1 <= count <= _MAX_COUNT:
            raise ValueError(f"COUNT is {count}")
        fields.append((label, scalar) if count == 1 else (label, scalar, (count,)))
    width, height = int(entries["WIDTH"][0]), int(entries.get("HEIGHT", ["1"])[0])
    n_points = width * height
    if min(width, height) < 0 or int(entries.get("POINTS", [str(n_points)])[0]) != n_points:
        raise ValueError(f"WIDTH {width}, HEIGHT {height} and POINTS do not agree")
    encoding = entries["DATA"][0].lower()
    if encoding not in ("ascii", "binary", "binary_compressed"):
        raise ValueError(f"DATA is {encoding}, not ascii, binary or binary_compressed")
    return Header(np.dtype(fields), n_points, _viewpoint(entries.get("VIEWPOINT")), encoding, start)


def _viewpoint(words: list[str] | None) -> Pose:
    """Return (4, 4) from x y z qw qx qy qz; the identity where absent or all zero."""
    from scipy.spatial.transform import Rotation

    numbers = np.array(words or ["0", "0", "0", "1", "0", "0", "0"], np.float64)
    if len(numbers) != 7:
        raise ValueError(f"VIEWPOINT has {len(numbers)} numbers, not 7")
    if not np.isfinite(numbers).all():
        return np.eye(4)
    if not (np.abs(numbers[:3]) < FARTHEST).all():
        raise ValueError(f"VIEWPOINT is at {numbers[:3]} m")
    wxyz = numbers[3:] if numbers[3:].any() else [1.0, 0.0, 0.0, 0.0]
    return make_transform(Rotation.from_quat(np.roll(wxyz, -1)).as_matrix(), numbers[:3])


# ------------------------------------------------------------------------------------------------------- points
def _columns(fields: dict[str, np.ndarray]) -> Columns:
    columns: Columns = {}
    for name, values in fields.items():
        columns |= {} if name.startswith("_") else columns_of_field(name, values)
    return columns


def _from_text(body: bytes, header: Header, path: Path) -> Columns:
    widths = [int(np.prod(header.dtype[name].shape, dtype=int)) for name in header.names]
    body = re.sub(rb"(?m)^\s*#.*", b"", body) if b"#" in body else body
    matrix = parse_points(path, body.rstrip(b"\0").replace(b",", b" "), sum(widths), 0, header.n_points, is_last=True)
    parts = zip(header.names, np.split(matrix, np.cumsum(widths)[:-1], axis=1), strict=True)
    return _columns({name: part if part.shape[1] > 1 else part[:, 0] for name, part in parts})


def _from_compressed(body: bytes, header: Header, path: Path) -> Columns:
    """Compressed points are stored field after field: all x, then all y, and so on."""
    require_bytes(path, len(body), 8, "their own number")
    # The longest copy, 264 bytes, takes 3.
    n_packed, n_unpacked = (int(size) for size in np.frombuffer(body, "<u4", 2))
    promised = header.n_points * header.dtype.itemsize
    if n_unpacked != promised:
        raise InputError(f"{path} is damaged: it says it unpacks to {n_unpacked} bytes, but its points need {promised}")
    require_bytes(path, min(len(body) - 8, n_packed), max(n_packed, n_unpacked // 88), f"{n_packed} that are packed")
    with damage_reported(path, "cannot be unpacked"):
        unpacked = decompress(np.frombuffer(body, np.uint8, n_packed, offset=8), n_unpacked)
    kinds = {name: header.dtype[name] for name in header.names}
    parts = np.split(unpacked, np.cumsum([kind.itemsize * header.n_points for kind in kinds.values()])[:-1])
    fields = zip(kinds.items(), parts, strict=True)
    columns = _columns({name: part.view(kind.base).reshape(-1, *kind.shape) for (name, kind), part in fields})
    require_in_place(columns, body, len(body) - 8 - n_packed, path)
    return columns
