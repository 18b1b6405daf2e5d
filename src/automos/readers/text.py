"""Tables of numbers in text, by NumPy's own parser: a scan as text has a million numbers."""

import re
from io import BytesIO
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError

_LINE = re.compile(rb"[^\n]*\S[^\n]*")


def parse_table(text: bytes, n_skipped: int = 0, n_rows: int | None = None) -> npt.NDArray[np.float64]:
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


def parse_points(
    path: Path, text: bytes, n_columns: int, n_skipped: int, n_points: int, is_last: bool
) -> npt.NDArray[np.float64]:
    """Return the (n_points, n_columns) numbers that a file's header promises; nothing follows where they are the last.

    Raises
    ------
    InputError
        Fewer points than promised, more of them, or points of another length.
    """
    if n_points == 0 and not (is_last and text.strip()):
        return np.zeros((0, n_columns))
    try:
        table = parse_table(text, n_skipped, n_points + is_last)
    except ValueError as error:
        raise InputError(f"{path} is damaged or cut short: {error} (counted from the end of its header)") from None
    if len(table) > n_points:
        raise InputError(f"{path} holds more points than the {n_points} that its header promises; copy it again")
    if len(table) < n_points:
        raise InputError(f"{path} is cut short: {len(table)} points, its header promises {n_points}; copy it again")
    if table.shape[1] != n_columns:
        raise InputError(f"{path} has {table.shape[1]} numbers a point, but its header names {n_columns}")
    return table
