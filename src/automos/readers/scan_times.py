"""Times of scans, from their names or from a table beside them.

Names hold seconds since 1970 or the start, in any unit, or dates; counters are none. A table (`times.txt`,
`timestamps.csv`) has one time a line, with whatever stands beside.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.pose_files import lines_of_scans
from automos.core.reading import is_there, read_text
from automos.core.scan import LATEST, Array
from automos.readers.column_names import is_time, parts_of_clock
from automos.readers.time_order import seconds_of, unevenness, usual_step

_EPOCH = (1.0e9, 2.2e9)
"""Seconds since 1970 that a recording may bear: 2001 to 2039."""
_PERIOD = (0.005, 5.0)
"""Seconds between scans (median) that distinguish a clock from a counter."""
_NUMBER = re.compile(r"\d+\.\d+|\d{9,10}[_-]\d{9}(?!\d)|\d+")
_DATE = re.compile(
    r"(?<!\d)(20\d\d)([-_.]?)(\d\d)\2(\d\d)[-_. T]*"  # the day
    r"(\d\d)([-_.:]?)(\d\d)\6(\d\d)(?:[-_.]?(\d{3,9}))?(?!\d)"  # hours, minutes, seconds and their fraction
)


def stamps_from_names(names: Sequence[str]) -> Array | None:
    """Return (N,) seconds if every name, without its suffix, holds a time at the same place, else None.

    Times are dates, seconds with decimals, seconds_nanoseconds, or whole seconds, milli-, micro- or nanoseconds since
    1970; they must differ and lie apart as scans do. So may nanoseconds of another clock that goes on evenly. Anything
    else is a counter.
    """
    numbers = [_NUMBER.findall(name) for name in names]
    found = _clock_of([_of_date(name) for name in names])
    for place in range(1, min(map(len, numbers), default=0) + 1):  # from the end: some count on behind their times
        texts = [one[-place] for one in numbers]
        found = _clock_of(list(map(_of_number, texts)), _unpadded(texts)) if found is None else found
        found = _clock_of(_since_start(texts)) if found is None else found
    return found


def _clock_of(*readings: Sequence[float | None]) -> Array | None:
    """Return the more even of some readings, (N,) seconds each, of those that may be a clock's; None of none."""
    known = [np.array(reading, np.float64) for reading in readings if len(reading) > 1 and None not in reading]
    steps = [np.diff(np.sort(stamps)) for stamps in known]
    likely = [
        (unevenness(step), i)
        for i, step in enumerate(steps)
        if step.min() > 0 and _PERIOD[0] <= np.median(step) <= _PERIOD[1]
    ]
    return known[min(likely)[1]] if likely else None


def _since_start(texts: Sequence[str]) -> Sequence[float | None]:
    """Return seconds where whole numbers may be nanoseconds of any clock, as they go on evenly; else nothing."""
    counts = np.array([text if text.isdecimal() else "nan" for text in texts], np.float64)
    steps = np.diff(np.sort(counts))
    return [1e-9 * count for count in counts] if 2.0 * unevenness(steps) < len(steps) else []


def _unpadded(texts: Sequence[str]) -> list[float | None]:
    """Return seconds where what is behind the points may be whole nanoseconds, 12.5000000 for 12.005; else nothing.

    Scripts join a message's seconds and nanoseconds so. None of these begins with a zero, and some have nine digits.
    """
    parts = [text.partition(".") for text in texts]
    lengths = {len(behind) for _, _, behind in parts}
    if max(lengths) != 9 or len(lengths) == 1 or any(str(int(behind or "-1")) != behind for _, _, behind in parts):
        return []
    return [int(seconds) + 1e-9 * int(behind) for seconds, _, behind in parts]


def _of_number(text: str) -> float | None:
    if "." in text:
        return float(text)
    if not text.isdecimal():
        seconds, nanoseconds = re.split("[_-]", text)
        return int(seconds) + int(nanoseconds) * 1e-9
    value = int(text)
    return next((value * unit for unit in (1e-9, 1e-6, 1e-3, 1.0) if _EPOCH[0] <= value * unit < _EPOCH[1]), None)


def _of_date(name: str) -> float | None:
    if (found := _DATE.search(name)) is None:
        return None
    with suppress(ValueError):  # a thirteenth month
        return seconds_of("{}-{}-{} {}:{}:{}.{}".format(*found.group(1, 3, 4, 5, 7, 8), found[9] or 0))
    return None


NAMES = [f"{stem}.{suffix}" for suffix in ("txt", "csv") for stem in ("times", "timestamps", "time", "timestamp")]
"""What the file may be called, the first that is there before others."""
_SLOWEST = 40.0, 5.0
"""Seconds between scans from which whole numbers are none of seconds, and at most, of a smaller unit."""
_DAY = re.compile(r"(\d{4}-\d\d-\d\d)[ T]+(?=\d\d:)")


def times_file(*folders: Path) -> Path:
    """Return where the scans' times are, in the first of some folders that has any; there or not."""
    places = [folder / name for folder in folders for name in NAMES]
    return next(filter(is_there, places), places[0])


def read_times(path: Path, names: Sequence[str]) -> Array:
    """Return (N,) the seconds that the file at `path` holds of scans called `names`, a line each.

    They may be dates, or whole numbers of milli-, micro- or nanoseconds, in a column that is called as times are, the
    only one of numbers, or the first that goes on otherwise than by one. Another may name the scans.

    Raises
    ------
    InputError
        It holds something else, or other numbers of them than the scans' names pick.
    """
    try:
        head, rows = _table(read_text(path))
        columns = list(zip(*rows, strict=True))
        times = _times_in(head, columns)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} must hold one time in seconds a line, or a date: {error}") from None
    step = usual_step(times) or 0.0
    if step > _SLOWEST[0] and np.array_equal(times, np.floor(times)):
        times = times * next((unit for unit in (1e-3, 1e-6) if unit * step <= _SLOWEST[1]), 1e-9)
    is_known = np.abs(times) < LATEST
    if not is_known.all():
        raise InputError(f"{path}, line {int(np.argmin(is_known)) + 1}: the time is not a number of seconds")
    keys = [_key(name) for name in names]
    for column in columns if len(columns) > 1 else ():
        line_of = {_key(cell): line for line, cell in enumerate(column)}
        if len(line_of) == len(rows) and line_of.keys() >= set(keys):
            return times[[line_of[key] for key in keys]]
    return times[lines_of_scans(len(times), len(names), names, path, "times")]


def _table(text: str) -> tuple[list[str], list[list[str]]]:
    """Return the names of the columns, none where the first line has numbers, and the cells of the other lines."""
    lines = [_DAY.sub(r"\1T", line.strip()) for line in text.splitlines() if line.strip() and line.strip()[0] != "#"]
    if any(";" in line for line in lines):
        lines = [line.replace(",", ".") for line in lines]
    divider = next((mark for mark in ";,\t" if lines and mark in lines[0]), None)
    rows = [[cell.strip(' "') for cell in line.split(divider)] for line in lines]
    has_names = bool(rows) and all(_seconds(cell) is None for cell in rows[0])
    head = [name.lower() for name in rows[0]] if has_names else []
    rows = rows[int(has_names) :]
    if (ragged := next((row for row in rows if len(row) != len(rows[0])), None)) is not None:
        raise ValueError(f"{' '.join(ragged)!r} has another number of columns than the lines before")
    return head, rows


def _times_in(head: Sequence[str], columns: Sequence[Sequence[str]]) -> Array:
    """Return (L,) the times among `columns`, as they are counted there."""
    known = {
        i: np.array(told, np.float64)
        for i, one in enumerate(columns)
        if None not in (told := [_seconds(cell) for cell in one])
    }
    if parts := parts_of_clock({head[i]: i for i in known} if head else ()):
        whole, rest = (known[head.index(name)] for name in parts)
        return whole + 1e-9 * rest
    clocks = [
        i for i, times in known.items() if (steps := np.diff(times)).min(initial=1.0) > 0.0 and (steps != 1.0).any()
    ]
    left = [i for i in known if head and is_time(head[i])] or [*known][: len(known) == 1] or clocks
    if not left:
        stray = next((cell for one in columns for cell in one if _seconds(cell) is None), "several columns")
        raise ValueError(f"it holds {stray!r}")
    return known[left[0]]


def _seconds(cell: str) -> float | None:
    try:
        return seconds_of(cell) if ":" in cell else float(cell)
    except ValueError:
        return None


def _key(name: str) -> str | int:
    """Return what a cell and a scan's name have in common: a file's name without folder and suffix, or its number."""
    stem = Path(name).name.partition(".")[0]
    return int(stem) if stem.isdecimal() else stem
