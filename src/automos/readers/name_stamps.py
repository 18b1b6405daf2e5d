"""Times that the names of scans hold: seconds since 1970 or the start, in any unit, or dates; counters are none."""

import re
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from automos.readers.time_order import seconds_of, unevenness

_EPOCH = (1.0e9, 2.2e9)
"""Seconds since 1970 that a recording may bear: 2001 to 2039."""
_PERIOD = (0.005, 5.0)
"""Seconds between scans (median) that distinguish a clock from a counter."""
_NUMBER = re.compile(r"\d+\.\d+|\d{9,10}[_-]\d{9}(?!\d)|\d+")
_DATE = re.compile(
    r"(?<!\d)(20\d\d)([-_.]?)(\d\d)\2(\d\d)[-_. T]*"  # the day
    r"(\d\d)([-_.:]?)(\d\d)\6(\d\d)(?:[-_.]?(\d{3,9}))?(?!\d)"  # hours, minutes, seconds and their fraction
)


def stamps_from_names(names: Sequence[str]) -> npt.NDArray[np.float64] | None:
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


def _clock_of(*readings: Sequence[float | None]) -> npt.NDArray[np.float64] | None:
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
