"""Packed records of mixed types without header, as recorders write their own structs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import read_bytes, read_text
from automos.readers.columns import Columns

_PAGE = 4096
"""Bytes of a page of memory. Fewer zeros may be the end of numbers."""


def read_records(path: Path, dtype: np.dtype) -> Columns:
    """Return the columns of a file of `dtype` records, without those whose name starts with an underscore.

    Raises
    ------
    InputError
        A file that is absent or no whole number of records.
    """
    try:
        raw = read_bytes(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    if len(raw) % dtype.itemsize:
        raise InputError(
            f"{path} has {len(raw)} bytes, no multiple of a point ({dtype.itemsize} bytes); it is cut short or of "
            "another sensor: copy it again"
        )
    rows = np.frombuffer(raw, dtype)
    return {name: rows[name] for name in dtype.names or () if not name.startswith("_")}


def require_no_more(rest: bytes, path: Path) -> None:
    """Raise where more than padding lies behind the last point that a header promises.

    Be it less than a point: bytes that were lost or came in before it have moved all points behind them.

    Raises
    ------
    InputError
        It does; zeros that fill a page of memory, as writers of mapped files leave them, and blanks do not.
    """
    is_page = len(rest) >= _PAGE and not any(rest)
    if rest.strip() and not is_page:
        raise InputError(
            f"{path} holds {len(rest)} bytes more than the points its header promises; it is damaged, or was copied as "
            "text: copy it again"
        )


def read_table(path: Path, n_columns: int, what: str, delimiter: str | None = None) -> np.ndarray:
    """Return the (R, n_columns) float64 numbers of a text file; lines starting with # are skipped.

    Raises
    ------
    InputError
        A file that is absent, empty, or not of that many numbers a line.
    """
    try:
        text = read_text(path).splitlines()
        lines = [line.split(delimiter) for line in text if line.strip() and not line.startswith("#")]
        table = np.array(lines, np.float64) if lines else np.zeros((0, n_columns))
    except FileNotFoundError:
        raise InputError(f"{path} is missing; the recording needs it for {what}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is not a table of {n_columns} numbers a line ({error})") from None
    if not np.isfinite(table).all():
        raise InputError(f"{path} holds a number that is none; {what} are {n_columns} numbers a line")
    if table.ndim != 2 or table.shape[1] != n_columns or len(table) == 0:
        raise InputError(f"{path} holds {table.shape} numbers; {what} are {n_columns} a line")
    return table
