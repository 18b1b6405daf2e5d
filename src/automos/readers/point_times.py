"""What the times of points and parts of a turn are good for: of one clock for all scans, or of no use; joined to scans.

Drivers write seconds, milli-, micro- or nanoseconds, after the scan's first point, since 1970 or since the sensor was
switched on. Times that cannot be are not used, and that is said once.

Some publish parts of a turn. A part looks beside where the one before it looked, always to the same side, until it has
come round. A sensor that looks forward, or all round, looks where it looked before.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import MIN_RANGE
from automos.readers.column_names import has_time, is_time
from automos.readers.columns import MAX_SWEEP, Columns, find_time_unit, is_measured, ring_column, time_column
from automos.readers.time_order import with_all_times

_LONGEST, _SHORTEST = 1.7, 0.01
"""Times the usual gap between scans that a sweep may last: more, or less, is of an unknown unit."""
_BACKWARDS = 0.9
"""Share of steps within a beam that go back in time from which the times are not those of the points."""


@dataclass(frozen=True, eq=False)
class PointTimes:
    """How the points' times of a recording are to be read.

    Attributes
    ----------
    unit : seconds per count; None where there are no times, or none of use.
    is_absolute : whether they are of one clock for all scans, so that they give the scans' times, too.
    warnings : why they are not used, in a sentence; none where they are.
    """

    unit: float | None = None
    is_absolute: bool = False
    warnings: tuple[str, ...] = ()


def judge_times(scans: Sequence[Columns], where: Path, gap: float | None = None) -> PointTimes:
    """Return how the times of points are to be read.

    Parameters
    ----------
    scans : a few scans' columns, the fullest first.
    where : the recording, for the warning.
    gap : seconds, the usual time between scans, where it is known.
    """
    times = time_column(scans[0])
    if times is None:
        if has_time(scans[0]) and len(scans[0].get("x", ())) > 1:
            return PointTimes(warnings=(f"{where}: the points' times are all the same or NaN; they are not used.",))
        return PointTimes()
    unit = find_time_unit(times)
    start, end = sweep_bounds(times, unit)
    why = None
    if gap is not None and not _SHORTEST * gap <= end - start <= _LONGEST * gap:
        why = f"span {end - start:.3g} s, but a scan comes every {gap:.3g} s"
    elif not end - start <= MAX_SWEEP:
        why = f"span {end - start:.3g} s in any unit, which no sweep lasts"
    elif _share_backwards(scans[0]) > _BACKWARDS:
        why = "run backwards within a beam"
    if why is not None:
        return PointTimes(warnings=(f"{where}: the points' times {why}; they are not used.",))
    known = [column for column in map(time_column, scans) if column is not None]
    starts = np.array([sweep_bounds(column, unit)[0] for column in known])
    return PointTimes(unit, len(starts) > 1 and float(np.ptp(starts)) > max(1.5 * (end - start), 0.01))


def sweep_bounds(times: npt.NDArray, unit: float) -> tuple[float, float]:
    """Return when a sweep began and ended, seconds on the clock of its points; NaN where no point has a time."""
    known = times[is_measured(times)]
    if len(known) == 0:
        return np.nan, np.nan
    first = known.min()
    # Subtract in the file's own type: nanoseconds since 1970 are beyond float64's whole numbers.
    return float(first) * unit, float(first) * unit + float(known.max() - first) * unit


def sweep_starts(
    read: Callable[[Path], Columns],
    paths: Sequence[Path],
    about: PointTimes,
    others: npt.NDArray[np.float64] | None,
) -> npt.NDArray[np.float64]:
    """Return (N,) seconds at which the sweeps in the files at `paths` begin; `others` if too few have any times."""

    def start(path: Path) -> float:
        times = time_column(read(path))
        return np.nan if times is None or about.unit is None else sweep_bounds(times, about.unit)[0]

    with ThreadPoolExecutor() as pool:
        times = with_all_times(np.array(list(pool.map(start, paths))))
    return times if others is None or np.isfinite(times).all() else others


def _share_backwards(columns: Columns) -> float:
    """Return the share of steps in time, from a point to the next of its beam in the file, that go back."""
    times, ring = time_column(columns), ring_column(columns)
    if times is None:
        return 0.0
    beam = np.zeros(len(times), np.uint16) if ring is None else ring
    order = np.argsort(beam, kind="stable")
    after, before = times[order][1:], times[order][:-1]
    is_step = (np.diff(beam[order]) == 0) & np.isfinite(after) & np.isfinite(before) & (after != before)
    return float((after < before)[is_step].mean()) if is_step.any() else 0.0


_SECTORS, _MOST = 72, 40
"""Directions that are told apart, and how many of them a part of a turn looks in at most: little more than half."""
_MOST_PARTS = 500
"""Clouds that are looked at: in as many, with a packet in each, two turns are over."""
_STEADY = 0.8
"""Length of the mean of the steps' directions, 1 being always the same step."""
_WHOLE = 0.1
"""Parts of a turn by which a whole number of them may be missed."""


@dataclass(frozen=True, eq=False)
class Parts:
    """The messages (n, 4) of one scan, rows of a bag's index, and seconds (n,) after the first, None without times."""

    rows: npt.NDArray[np.int64]
    since: npt.NDArray[np.float64] | None = None


def places_in_time(stamps: npt.NDArray[np.float64] | None, n: int) -> npt.NDArray[np.int64]:
    """Return (n,) the place of each cloud in an even row of them, in which those that are missing have places, too."""
    if stamps is None or n < 2:
        return np.arange(n)
    steps = np.diff(stamps)
    return np.concatenate([[0], np.cumsum(np.round(steps / np.median(steps)))]).astype(np.int64)


def parts_in_a_turn(points: Callable[[int], npt.NDArray], places: npt.NDArray[np.int64]) -> float:
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


def parts_said(
    points: Callable[[int], npt.NDArray], stamps: npt.NDArray[np.float64] | None, n: int, where: Path
) -> list[str]:
    """Return what to say where each of `n` files holds a part of a turn, which has labels of its own; else nothing."""
    with suppress(InputError):  # reported when the scan itself is read
        if parts_in_a_turn(points, places_in_time(stamps, n)) >= 2.0:
            said = "a file holds a part of a turn and is labelled as a scan of its own, which finds little"
            return [f"{where}: {said}; write a file for each turn."]
    return []


def _way(ahead: npt.NDArray, at: npt.NDArray, least: float) -> tuple[npt.NDArray, npt.NDArray]:
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


def joined(parts: Sequence[Columns], since: npt.NDArray[np.float64] | None, unit: float | None) -> Columns:
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
