"""Tables of numbers in text, parsed by a compiled loop: a scan as text has a million numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.kernels import kernel

_POWERS = 10.0 ** np.arange(23)
"""Those that float64 holds exactly, so that numbers of up to 15 digits are rounded once, as correctly as can be."""

_NEWLINE, _PLUS, _MINUS, _POINT, _ZERO, _NINE, _E = (ord(c) for c in "\n+-.09e")
_NAN, _INF, _INFINITY = (np.frombuffer(word, np.uint8) for word in (b"nan", b"inf", b"infinity"))


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
    characters, most = np.frombuffer(text, np.uint8), len(text)  # a header may promise more rows than an integer holds
    n_skipped, n_rows = min(n_skipped, most), most if n_rows is None else min(n_rows, most)
    begin, end, rows, columns, ragged = _find_table(characters, n_skipped, n_rows)
    if ragged >= 0 and text[ragged] < 32 and not text[ragged : ragged + 1].isspace():
        raise ValueError(f"line {_line_number(text, ragged)} holds the byte {text[ragged]:#04x}, which is not text")
    if ragged >= 0:
        raise ValueError(f"line {_line_number(text, ragged)} has not {columns} numbers, as those before it have")
    table = np.empty((rows, columns))
    bad = _parse_numbers(characters, begin, end, table.reshape(-1))
    if bad >= 0:
        word = text[bad : bad + 40].split()[0].decode("ascii", "replace")
        raise ValueError(f"line {_line_number(text, bad)} holds {word!r}, which is not a number")
    return table


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


def _line_number(text: bytes, position: int) -> int:
    return text.count(b"\n", 0, position) + 1


@kernel
def _find_table(text, n_skipped, n_rows):  # type: ignore[no-untyped-def]
    """Return begin, end, rows and columns of the wanted lines, where no text or a line of another length is, or -1."""
    begin, end, rows, columns = 0, 0, 0, 0
    seen, words, line_start, in_word = 0, 0, 0, False
    for i in range(len(text) + 1):
        is_end = i == len(text) or text[i] == _NEWLINE
        if not is_end and text[i] > 32:
            words += not in_word
            in_word = True
            continue
        in_word = False
        if not is_end:
            if text[i] < 9 or 13 < text[i] < 32:  # neither printed nor a blank
                return begin, end, rows, columns, i
            continue
        if words > 0:
            seen += 1
            if seen > n_skipped and rows < n_rows:
                if rows == 0:
                    begin, columns = line_start, words
                elif words != columns:
                    return begin, end, rows, columns, line_start
                rows += 1
                end = i
        words, line_start = 0, i + 1
        if rows == n_rows:
            break
    return begin, end, rows, columns, -1


@kernel
def _parse_numbers(text, begin, end, out):  # type: ignore[no-untyped-def]
    """Fill `out` with the numbers in text[begin:end]; return the place of a word that is none, or -1."""
    n, i = 0, begin
    while i < end:
        if text[i] <= 32:
            i += 1
            continue
        start = i
        is_negative = text[i] == _MINUS
        if is_negative or text[i] == _PLUS:
            i += 1
        value, i = _parse_decimal(text, i, end)
        if i < 0:
            value, i = _parse_word(text, start + (is_negative or text[start] == _PLUS), end)
        if i < 0 or (i < end and text[i] > 32):
            return start
        out[n] = -value if is_negative else value
        n += 1
    return -1


@kernel
def _parse_decimal(text, i, end):  # type: ignore[no-untyped-def]
    """Return the unsigned decimal number at `i` and the place behind it, -1 if there is none."""
    mantissa, exponent, digits, behind_point = np.uint64(0), 0, 0, False
    while i < end:
        c = text[i]
        if _ZERO <= c <= _NINE:
            digits += 1
            if mantissa < np.uint64(10**17):
                mantissa = mantissa * np.uint64(10) + np.uint64(c - _ZERO)
                exponent -= behind_point
            else:  # more digits than float64 can hold
                exponent += not behind_point
        elif c == _POINT and not behind_point:
            behind_point = True
        else:
            break
        i += 1
    if digits == 0:
        return 0.0, -1
    if i < end and (text[i] | 32) == _E:
        i += 1
        sign = -1 if i < end and text[i] == _MINUS else 1
        if i < end and (text[i] == _MINUS or text[i] == _PLUS):
            i += 1
        if i >= end or not _ZERO <= text[i] <= _NINE:
            return 0.0, -1
        power = 0
        while i < end and _ZERO <= text[i] <= _NINE:
            power = min(10 * power + np.int64(text[i]) - _ZERO, 100000)
            i += 1
        exponent += sign * power
    value = np.float64(mantissa)
    if 0 <= exponent <= 22:
        return value * _POWERS[exponent], i
    if -22 <= exponent < 0:
        return value / _POWERS[-exponent], i
    return (value * 10.0**exponent if value > 0.0 else 0.0), i


@kernel
def _parse_word(text, i, end):  # type: ignore[no-untyped-def]
    """Return what the word nan, inf or infinity at `i` stands for and the place behind it, -1 if it is none of them."""
    if _is_word(text, i, end, _NAN):
        return np.nan, i + len(_NAN)
    if _is_word(text, i, end, _INFINITY):
        return np.inf, i + len(_INFINITY)
    if _is_word(text, i, end, _INF):
        return np.inf, i + len(_INF)
    return 0.0, -1


@kernel
def _is_word(text, i, end, word):  # type: ignore[no-untyped-def]
    if i + len(word) > end:
        return False
    return np.all((text[i : i + len(word)] | 32) == word)
