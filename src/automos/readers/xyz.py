"""Points as text, one a line: x y z [intensity [ring]], or columns named in the first line.

Blanks, tabs, commas or semicolons divide the columns; lines starting with # or // are comments, and one before the
numbers that names x, y and z names the columns; else the first line that is none may. Names may hold blanks where
something else divides them. Titles may stand above the names, and units below.
"""

import csv
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from contextlib import suppress
from itertools import compress
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import damage_reported, read_bytes
from automos.readers.column_names import is_time, plain_names
from automos.readers.columns import Columns, from_matrix
from automos.readers.record_columns import ENOUGH
from automos.readers.record_layout import names_of
from automos.readers.records import parse_table

_DIVIDERS = bytes.maketrans(b",;", b"  ")
_EMPTY = (b",,", b";;", b", ,", b"; ;", b",\t,", b";\t;", b"\n,", b"\n;")
"""What a cell without a number looks like; left out it would move all that follow it to other columns."""
_COMMA_WITHIN, _BLANK_BETWEEN = re.compile(rb"\d,\d"), re.compile(rb"[^,\s][ \t]+[^,\s]")
"""Where a line has both, its commas are those of decimals."""
_COMMENT = re.compile(rb"(#|//)[^\n]*")
_REMARK = re.compile(rb"\s*(#|//)[^\n]*\n?")
_QUOTED = re.compile(rb'"([^"\n]*)"')
_INDEFINITE = re.compile(rb"-?(nan\(\w+\)|1\.#[A-Z]+)")
"""What C's library on Windows writes for NaN."""
_TITLES = 20
"""Lines that may stand above the names of columns."""
_SEPARATOR = re.compile(rb"\Asep=.\n")
"""What spreadsheets are told."""


def read(path: Path, columns: str = "") -> Columns:
    """Return the columns of one file, as `columns` or its first line names them, else x, y, z, intensity, ring."""
    text = read_bytes(path).removeprefix(BOM_UTF8).lstrip()  # spreadsheets begin "CSV UTF-8" with that mark
    if text.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        text = text.decode("utf-16", "replace").encode().lstrip()
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = _SEPARATOR.sub(b"", text)
    text = _INDEFINITE.sub(b"nan", text) if b"nan(" in text or b".#" in text else text
    text = _behind_titles(text.replace(b"|", b";"))
    first_line, _, rest = _behind_remarks(text).partition(b"\n")
    names = _names_in(first_line)
    axes = [name.lower() for name in names if name.lower() in ("x", "y", "z")]
    if len(set(axes)) < len(axes) or any(map(_is_number, names)):
        raise InputError(f"{path} names x, y or z twice, or a column by a number, in its first line; copy it again")
    names, rest = _with_units(names, rest)
    numbers = rest if names else text
    numbers = _COMMENT.sub(b"", numbers) if b"#" in numbers or b"//" in numbers else numbers
    if b'"' in numbers:
        numbers = _QUOTED.sub(lambda cell: cell[1].replace(b",", b"."), numbers)
    if (b";" in numbers or b"\t" in numbers) and b"," in numbers and b"." not in numbers:
        numbers = numbers.replace(b",", b".")  # of countries that write decimals so
    if names:
        names, numbers = _without_words(names, numbers)
    elif first_line.strip().isdigit() and int(first_line) == sum(map(bool, map(bytes.strip, rest.split(b"\n")))):
        numbers = rest  # the count of the points comes first
    _require_one_divider(numbers, path)
    with damage_reported(path, "is not a table of numbers"):
        matrix = parse_table(numbers.translate(_DIVIDERS))
    if len(matrix) == 0:
        matrix = np.zeros((0, len(names) or 3))
    if not columns and not names and len(matrix) > ENOUGH and not np.ptp(np.diff(matrix[:, :3], axis=0), axis=0).all():
        raise InputError(
            f"{path} does not name its columns, and one of the first three counts; name them with --columns"
        )
    if columns or not names:
        return from_matrix(matrix, path, names_of(matrix, path, columns))
    if len(names) != matrix.shape[1]:
        raise InputError(
            f"{path} names {len(names)} columns in its first line but has {matrix.shape[1]}; name them with --columns"
        )
    return {name or f"_{i}": matrix[:, i] for i, name in enumerate(names)}


def _with_units(names: list[str], lines: bytes) -> tuple[list[str], bytes]:
    """Return the names with the units that the first line holds, if it does, and the lines behind these."""
    first, _, rest = lines.partition(b"\n")
    units = _names_in(first) if names else []
    if not units or len(units) != len(names) or any(map(_is_number, units)):
        return names, lines
    return [f"{name} [{unit.strip('[](){}')}]" for name, unit in zip(names, units, strict=True)], rest


def _without_words(names: list[str], numbers: bytes) -> tuple[list[str], bytes]:
    """Return the names and the lines without columns that hold words, as classes, in the first line.

    Dates in a column of times become nanoseconds.
    """
    lines = [line for line in numbers.split(b"\n") if line.strip()]
    divider = next((mark for mark in (b"\t", b";", b",") if lines and mark in lines[0]), None)
    cells = lines[0].split(divider) if lines else []
    is_kept = [_is_number(cell.decode("utf-8", "replace")) for cell in cells]
    are_axes = {"x", "y", "z"} <= set(plain_names([name for name, kept in zip(names, is_kept, strict=False) if kept]))
    if all(is_kept) or not are_axes or any(line.count(divider or b" ") != len(names) - 1 for line in lines):
        return names, numbers
    told = [line.split(divider) for line in lines]
    for k in (k for k, name in enumerate(names) if is_time(name) and not is_kept[k]):
        with suppress(ValueError):  # no date
            dates = np.array([_as_date(row[k]) for row in told], "M8[ns]").view(np.int64)
            for row, date in zip(told, dates, strict=True):
                row[k] = b"%d" % date
            is_kept[k] = True
    return list(compress(names, is_kept)), b"\n".join(b" ".join(compress(row, is_kept)) for row in told)


def _as_date(cell: bytes) -> str:
    return cell.decode("utf-8", "replace").strip(' "').removesuffix("Z").replace(" ", "T")


def _require_one_divider(numbers: bytes, path: Path) -> None:
    """Raise where it is not clear what divides the columns of `numbers`, of which another point would come out."""
    commas, semicolons = b"," in numbers, b";" in numbers
    if not commas and not semicolons:
        return
    line = numbers.lstrip().partition(b"\n")[0]
    if (commas and semicolons) or (_COMMA_WITHIN.search(line) and _BLANK_BETWEEN.search(line)):
        raise InputError(f"{path} divides numbers by commas and by something else; write decimals with a point")
    if numbers.startswith((b",", b";")) or any(empty in numbers for empty in _EMPTY):
        raise InputError(f"{path} has cells without a number; write nan in them, or leave the column out")


def _behind_remarks(text: bytes) -> bytes:
    """Return `text` without the comments at its start, up to one that names the columns."""
    at = 0
    while (remark := _REMARK.match(text, at)) and not _names_in(remark[0].lstrip()):
        at = remark.end()
    return text[at:].lstrip()


def _behind_titles(text: bytes) -> bytes:
    """Return `text` from the line on that names x, y and z, where nothing but words stands above it."""
    at = 0
    for _ in range(_TITLES):
        end = text.find(b"\n", at)
        if not (names := _names_in(text[at : max(end, at)])) and text[at : max(end, at)].strip():
            break  # numbers, or a comment
        if {"x", "y", "z"} <= set(plain_names(names)):
            return text[at:]
        at = end + 1
    return text


def _names_in(line: bytes) -> list[str]:
    """Return the column names that a line holds, none if it holds numbers or a remark."""
    if all(map(_is_number, line.translate(_DIVIDERS).decode("utf-8", "replace").split())):
        return []
    text = line.decode("utf-8", "replace").strip()
    is_remark = text.startswith(("#", "//"))
    text = text.lstrip("#/ ") if is_remark else text
    bare = re.sub('"[^"]*"', "", text)  # statistics programs quote names
    divider = next((mark for mark in "\t;," if mark in bare), None)
    if divider is None:
        names = [quoted or word for quoted, word in re.findall(r'"([^"]*)"|(\S+)', text)]
    else:
        names = [name.strip() for name in next(csv.reader([text], delimiter=divider, skipinitialspace=True))]
        names = names if names[-1] else names[:-1]
    return [] if is_remark and not {"x", "y", "z"} <= set(plain_names(names)) else names


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
