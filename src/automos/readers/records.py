"""Numbers as recorders write them: packed records of mixed types without header, and text tables by NumPy's parser."""

import re
from io import BytesIO
from itertools import islice
from pathlib import Path

import numpy as np

from automos.core.arrays import Array
from automos.core.errors import InputError
from automos.core.reading import damage_reported, read_bytes, read_text
from automos.readers.columns import Columns

SHARE = 0.99
"""Share of numbers that must be lengths where points are expected."""
_SMALLEST, _LARGEST = 1e-7, 1e7
"""Metres of a coordinate, where it is not zero: bits that are none are spread over all that numbers can be."""
_PLACES = re.compile(r"xyz|points?|pos(itions?)?|coord(s|inates)?|cartesian")
_LAST = 100
"""Points at the end of a file that show whether bytes came in before them."""


def read_records(path: Path, dtype: np.dtype) -> Columns:
    """Return the columns of a file of `dtype` records, without those whose name starts with an underscore.

    Raises
    ------
    InputError
        A file that is absent or no whole number of records.
    """
    with damage_reported(path):
        raw = read_bytes(path)
    if len(raw) % dtype.itemsize:
        raise InputError(
            f"{path} has {len(raw)} bytes, no multiple of a point ({dtype.itemsize} bytes); it is cut short or of "
            "another kind: copy it again, or say with --columns which columns it has"
        )
    rows = np.frombuffer(raw, dtype)
    return {name: rows[name] for name in dtype.names or () if not name.startswith("_")}


@np.errstate(invalid="ignore")
def are_lengths(values: np.ndarray) -> bool:
    """Return whether nearly all of `values` are none (NaN, infinite), zero, or of a size that lengths have."""
    size = np.abs(values)
    is_none = ~np.isfinite(size) | (size == 0)
    return bool((is_none | ((size > _SMALLEST) & (size < _LARGEST))).mean() >= SHARE)


def columns_of_field(name: str, values: np.ndarray) -> Columns:
    """Return the columns that a field is: itself (N,), x, y and z (N, 3) where it is called as places are, or none."""
    if values.ndim == 2 and values.shape[1] == 3 and _PLACES.fullmatch(name.lower()):
        return {axis: values[:, k] for k, axis in enumerate("xyz")}
    return {name: values} if values.ndim == 1 else {}


def require_bytes(where: Path | str, got: int, needed: int, what: str) -> None:
    """Raise InputError where a file or a message has fewer bytes, `got`, than `what` it promises needs."""
    if got < needed:
        raise InputError(f"{where} is cut short: {got} bytes for {what}; copy, record or export it again")


def require_in_place(columns: Columns, body: bytes, n_surplus: int, path: Path) -> None:
    """Raise where the bytes that a file holds too many came in before its last points: all behind them are others.

    Bytes behind the last point do no harm, as writers of mapped files leave them.

    Parameters
    ----------
    columns : the points.
    body : what is behind the header; `n_surplus` bytes of it are not promised.

    Raises
    ------
    InputError
        The last points are none, or each line feed has got a carriage return.
    """
    if not n_surplus:
        return
    is_text = body.count(b"\r\n") == n_surplus == body.count(b"\n")
    ends = [columns[axis][-_LAST:] for axis in "xyz" if axis in columns and columns[axis].dtype.kind == "f"]
    if is_text or not all(are_lengths(end) for end in ends if len(end)):
        raise InputError(
            f"{path} holds {n_surplus} bytes more than the points its header promises, and they came in between "
            "points, as where it was copied as text: copy it again"
        )


def read_table(
    path: Path, n_columns: int, what: str, delimiter: str | None = None, has_names: bool = False
) -> np.ndarray:
    """Return the (R, n_columns) float64 numbers of a text file; lines starting with # are skipped, and one of names.

    Raises
    ------
    InputError
        A file that is absent, empty, or not of that many numbers a line.
    """
    needed = f"the recording needs it for {what}"
    with damage_reported(path, f"is not a table of {n_columns} numbers a line", missing=needed):
        text = read_text(path).splitlines()[int(has_names) :]
        lines = [line.split(delimiter) for line in text if line.strip() and not line.startswith("#")]
        table = np.array(lines, np.float64)
        if not np.isfinite(table).all():
            raise ValueError("it holds a number that is none")
    if table.ndim != 2 or table.shape[1] != n_columns:
        raise InputError(f"{path} holds {table.shape} numbers; {what} are {n_columns} a line")
    return table


_LINE = re.compile(rb"[^\n]*\S[^\n]*")


def parse_table(text: bytes, n_skipped: int = 0, n_rows: int | None = None) -> Array:
    """Return the (N, C) numbers of `text`, a row for each line that is not blank; (0, 0) where there is none.

    Parameters
    ----------
    text : ASCII, numbers divided by blanks; nan and inf are numbers.
    n_skipped : rows left out at the start.
    n_rows : rows read, at most; none: all.

    Raises
    ------
    ValueError
        If rows differ in length or hold something that is not a number. NUL bytes are not blanks: a disk that lost data
        leaves them.
    """
    most = len(text)  # a header may promise more rows than an integer holds
    first, last = min(n_skipped, most), most if n_rows is None else min(n_skipped + n_rows, most)
    lines = b"\n".join(line[0] for line in islice(_LINE.finditer(text), first, last))
    if not lines:
        return np.zeros((0, 0))
    try:
        return np.loadtxt(BytesIO(lines), comments=None, ndmin=2)
    except ValueError as error:
        raise ValueError(str(error).partition(";")[0].rstrip(".")) from None


def parse_points(path: Path, text: bytes, n_columns: int, n_skipped: int, n_points: int, is_last: bool) -> Array:
    """Return the (n_points, n_columns) numbers that a file's header promises; nothing follows where they are the last.

    Raises
    ------
    InputError
        Fewer points than promised, more of them, or points of another length.
    """
    if n_points == 0 and not (is_last and text.strip()):
        return np.zeros((0, n_columns))
    with damage_reported(path, "is damaged or cut short, counted from the end of its header"):
        table = parse_table(text, n_skipped, n_points + is_last)
    if len(table) > n_points:
        raise InputError(f"{path} holds more points than the {n_points} that its header promises; copy it again")
    if len(table) < n_points:
        raise InputError(f"{path} is cut short: {len(table)} points, its header promises {n_points}; copy it again")
    if table.shape[1] != n_columns:
        raise InputError(f"{path} has {table.shape[1]} numbers a point, but its header names {n_columns}")
    return table
