"""Parts of a turn, as some drivers publish them: whether clouds are such, and how they are joined to whole turns.

A part looks beside where the one before it looked, always to the same side, until it has come round. A sensor that
looks forward, or all round, looks where it looked before.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.scan import MIN_RANGE, Array, Ints
from automos.readers.column_names import is_time
from automos.readers.columns import Columns, time_column

_SECTORS, _MOST = 72, 40
"""Directions that are told apart, and how many of them a part of a turn looks in at most: little more than half."""
_MOST_PARTS = 500
"""Clouds that are looked at: in as many, with a packet in each, two turns are over."""
_STEADY = 0.8
"""Length of the mean of the steps' directions, 1 being always the same step."""
_WHOLE = 0.1
"""Parts of a turn by which a whole number of them may be missed."""


class Parts(NamedTuple):
    """The messages (n, 4) of one scan, rows of a bag's index, and seconds (n,) after the first, None without times."""

    rows: Ints
    since: Array | None = None


def places_in_time(stamps: Array | None, n: int) -> Ints:
    """Return (n,) the place of each cloud in an even row of them, in which those that are missing have places, too."""
    if stamps is None or n < 2:
        return np.arange(n)
    steps = np.diff(stamps)
    return np.concatenate([[0], np.cumsum(np.round(steps / np.median(steps)))]).astype(np.int64)


def parts_in_a_turn(points: Callable[[int], np.ndarray], places: Ints) -> float:
    """Return how many clouds make a turn, 1 where they are no parts of one.

    Parameters
    ----------
    points : returns the (N, 3) coordinates of a cloud; the clouds are read one after the other, until two turns are
        over or it is seen that they are no parts.
    places : (n,) of each cloud in time, as `places_in_time` returns them.
    """
    n = len(places)
    start = n // 2 if n > 2 * _MOST_PARTS else min(1, n - 1)  # the first may be less than a part
    ahead, at, seen = [], [], []
    way, place = np.zeros(1), np.zeros(1)
    for index in range(start, min(n, start + _MOST_PARTS)):
        x, y, _ = points(index).astype(np.float64).T
        azimuth = np.arctan2(y, x)[np.isfinite(x) & np.isfinite(y) & (np.hypot(x, y) > MIN_RANGE)]
        if not len(azimuth):
            continue
        seen.append(len(np.unique(np.floor(azimuth * (_SECTORS / (2.0 * np.pi))))))
        if seen[-1] > _MOST:
            return 1.0
        ahead.append(np.exp(1j * azimuth).mean())
        at.append(places[index])
        if len(at) < 3:
            continue
        way, place = _way(np.array(ahead), np.array(at), np.pi / _SECTORS * np.median(seen))
        if not len(way) or abs(way[-1]) >= 4.0 * np.pi:
            break
    turns = int(np.abs(way[-1:]).sum() / (2.0 * np.pi) + 1e-6)
    if not turns:
        return 1.0
    parts = float(np.interp(2.0 * np.pi * turns, np.abs(way), place)) / turns
    return float(round(parts)) if abs(parts - round(parts)) <= _WHOLE else parts


def parts_said(points: Callable[[int], np.ndarray], stamps: Array | None, n: int, where: Path) -> list[str]:
    """Return what to say where each of `n` files holds a part of a turn, which has labels of its own; else nothing."""
    with suppress(InputError):  # reported when the scan itself is read
        if parts_in_a_turn(points, places_in_time(stamps, n)) >= 2.0:
            said = "a file holds a part of a turn and is labelled as a scan of its own, which finds little"
            return [f"{where}: {said}; write a file for each turn."]
    return []


def _way(ahead: np.ndarray, at: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (n,) clouds that look `ahead` (complex) have turned since the first, rad, and their places since.

    Both are empty where they do not turn by `least` from a place to the next, or not steadily.
    """
    apart = np.diff(at)
    steps = np.diff(np.angle(ahead))
    next_to = steps[apart == 1] if (apart == 1).any() else steps
    mean = np.exp(1j * next_to).mean()
    usual = float(np.angle(mean))
    if abs(mean) < _STEADY or abs(usual) < least:
        return np.zeros(0), np.zeros(0)
    off = np.angle(np.exp(1j * (steps - apart * usual)))
    return np.concatenate([[0.0], np.cumsum(apart * usual + off)]), (at - at[0]).astype(np.float64)


def joined(parts: Sequence[Columns], since: Array | None, unit: float | None) -> Columns:
    """Return the columns of several parts of a scan as those of one, in their order.

    Parameters
    ----------
    parts, since : the columns of each, and the seconds of each after the first.
    unit : seconds per count of the points' times, None where they have none of use; those that begin anew in each part
        are put behind each other.
    """
    full = [k for k, part in enumerate(parts) if len(next(iter(part.values()), ()))] or [0]
    names = [name for name in parts[full[0]] if all(name in parts[k] for k in full)]
    whole = {name: np.concatenate([parts[k][name] for k in full]) for name in names}
    known = [time_column(parts[k]) for k in full]
    if since is None or unit is None or any(column is None for column in known):
        return whole
    seconds = [unit * column.astype(np.float64) for column in known if column is not None]
    spans, begins = [float(np.ptp(one)) for one in seconds], [float(one.min()) for one in seconds]
    if np.median(np.abs(np.diff(begins))) > 0.5 * np.median(spans):  # they go on from part to part
        return whole
    behind = np.concatenate([one + since[k] for k, one in zip(full, seconds, strict=True)])
    return {**{name: column for name, column in whole.items() if not is_time(name)}, "t": behind}
