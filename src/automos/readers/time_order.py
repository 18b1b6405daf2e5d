"""Scans in the order of time: what their files' order and their clock make of each other.

Copies are renumbered (0, 1, 10, 11, ..., 2), clocks repeat and jump. Files that are out of the order of their times are
put in order. A clock that jumps back and goes on evenly from there was set, and its order is not that of the scans: of
the two, what makes the steps of the clock more even is what happened.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

_HOLE = 60.0
"""Seconds, at most, after which a clock that began at 0 shows its next time."""
_ONE_TIME = 1e-9
"""Seconds, below the resolution of any clock: times that differ by less are equal."""


def seconds_of(date: str) -> float:
    """Return the seconds since 1970 of a date with nanoseconds."""
    whole, _, fraction = date.partition(".")
    return datetime.fromisoformat(whole).replace(tzinfo=UTC).timestamp() + float(f"0.{fraction or 0}")


@dataclass(frozen=True, eq=False)
class TimeOrder:
    """In which order scans were taken.

    Attributes
    ----------
    order : (N,) int64, the scans' numbers in the order of time.
    stamps : (N,) seconds, strictly increasing, in that order; None without a usable clock.
    warnings : what was found and done, in sentences.
    """

    order: npt.NDArray[np.int64]
    stamps: npt.NDArray[np.float64] | None
    warnings: list[str]


def put_in_order(stamps: npt.NDArray[np.float64], names: Sequence[str], where: Path) -> TimeOrder:
    """Return the order of scans whose times are `stamps` (N,) in seconds; `names` and `where` are for the warnings."""
    as_given = np.arange(len(stamps))
    apart = np.diff(np.unique(stamps))
    if ((apart > 0.0) & (apart < _ONE_TIME)).any():
        stamps = np.round(stamps / _ONE_TIME) * _ONE_TIME
    steps = np.diff(stamps)
    if (steps > 0.0).all():
        return TimeOrder(as_given, stamps, [])
    if not np.isfinite(stamps).all() or (steps == 0.0).sum() > 0.5 * len(steps):
        first = names[int(np.argmin(np.isfinite(stamps)))] if not np.isfinite(stamps).all() else names[1]
        return TimeOrder(
            as_given, None, [f"{where}: the clock stands still or has no time (first at scan {first}); it is not used."]
        )
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.1
    back = np.flatnonzero(steps < 0.0)
    if not len(back):
        return TimeOrder(as_given, _apart(stamps, usual), [_repeated(stamps, names, where)])
    late = int(back[0]) + 1
    said = f"scan {names[late]} is {-steps[late - 1]:.2f} s before the one that comes ahead of it, {names[late - 1]}"
    order = np.argsort(stamps, kind="stable")
    ordered = stamps[order]
    if unevenness(steps[steps >= 0.0]) + len(back) < unevenness(np.diff(ordered)):
        steps = np.where(steps < 0.0, usual, steps)
        mended = stamps[0] + np.concatenate([[0.0], np.cumsum(steps)])
        return TimeOrder(
            as_given,
            _apart(mended, usual),
            [f"{where}: the clock jumps back at {len(back)} scans ({said}); it is taken to go on evenly there."],
        )
    n_moved = int((order != as_given).sum())
    warnings = [f"{where}: the scans are not in the order of time ({said}); {n_moved} were put in their place."]
    in_order = [names[i] for i in order]
    if (np.diff(ordered) == 0.0).any():
        warnings.append(_repeated(ordered, in_order, where))
    return TimeOrder(order, _apart(ordered, usual), warnings)


def unevenness(steps: npt.NDArray[np.float64]) -> float:
    """Return by how many usual steps `steps` (N,), >= 0, differ from the usual one, in sum."""
    usual = float(np.median(steps)) if len(steps) else 1.0
    return float(np.abs(steps - usual).sum()) / usual if usual > 0.0 else np.inf


def count_unset(stamps: npt.NDArray[np.float64]) -> int:
    """Return how many of the messages' stamps (N,) nobody set: those that are 0, or all where all are the same.

    A simulation's clock may begin at 0, and goes on from there.
    """
    if len(stamps) < 2:
        return 0
    if stamps.min() == stamps.max():
        return len(stamps)
    unset = np.flatnonzero(stamps == 0.0)
    begins_there = unset.tolist() == [0] and 0.0 < stamps[1] < _HOLE
    return 0 if begins_there else len(unset)


def usual_step(stamps: npt.NDArray[np.float64] | None) -> float | None:
    """Return the seconds that usually lie between scans at `stamps` (N,), in any order; None without a clock."""
    steps = np.zeros(0) if stamps is None else np.diff(np.sort(stamps))
    return float(np.median(steps[steps > 0.0])) if len(steps) > 1 and (steps > 0.0).any() else None


def with_all_times(stamps: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return `stamps` (N,) with the few that are NaN, of scans without points, evenly between those beside them.

    Beyond the ends, usual steps lead on. Where more than half are NaN there is no clock, and they are left.
    """
    known = np.flatnonzero(np.isfinite(stamps))
    steps = np.diff(stamps[known]) / np.diff(known)
    if not (steps > 0.0).any() or 2 * len(known) < len(stamps):
        return stamps
    rows, step = np.arange(len(stamps)), np.median(steps[steps > 0.0])
    beyond = np.minimum(rows - known[0], 0) + np.maximum(rows - known[-1], 0)
    return np.where(np.isfinite(stamps), stamps, np.interp(rows, known, stamps[known]) + step * beyond)


def _repeated(stamps: npt.NDArray[np.float64], names: Sequence[str], where: Path) -> str:
    again = np.flatnonzero(np.diff(stamps) == 0.0) + 1
    return f"{where}: {len(again)} scans have the time of the one before them (first: {names[again[0]]})."


def _apart(stamps: npt.NDArray[np.float64], usual: float) -> npt.NDArray[np.float64]:
    """Return `stamps` (N,), which do not decrease, with those of one time spread to the next, a usual step at most."""
    values, first, count = np.unique(stamps, return_index=True, return_counts=True)
    room = np.minimum(np.append(np.diff(values), usual), usual)
    which = np.repeat(np.arange(len(values)), count)
    return values[which] + (np.arange(len(stamps)) - first[which]) * (room / count)[which]
