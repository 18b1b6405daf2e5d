"""Scans in the order of time: what their files' order and their clock make of each other, or what they saw.

Copies are renumbered (0, 1, 10, 11, ..., 2), clocks repeat and jump. Files that are out of the order of their times are
put in order. A clock that jumps back and goes on evenly from there was set, and its order is not that of the scans: of
the two, what makes the steps of the clock more even is what happened.

Without any times, scans that follow each other look alike: where the steps that only the right order has join scans
that are clearly more alike than those that only the files' order has, the copy is put in order. A handful of these
steps decides, so that opening a long recording costs no more than opening a short one.
"""

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.scan import Array, Ints, Points

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

    order: Ints
    stamps: Array | None
    warnings: list[str]


def put_in_order(stamps: Array, names: Sequence[str], where: Path) -> TimeOrder:
    """Return the order of scans whose times are `stamps` (N,) in seconds; `names` and `where` are for the warnings."""
    as_given = np.arange(len(stamps))
    apart = np.diff(np.unique(stamps))
    if ((apart > 0.0) & (apart < _ONE_TIME)).any():
        stamps = np.round(stamps / _ONE_TIME) * _ONE_TIME
    steps = np.diff(stamps)
    if (steps > 0.0).all():
        return TimeOrder(as_given, stamps, [])
    is_known = np.isfinite(stamps)
    if not is_known.all() or (steps == 0.0).sum() > 0.5 * len(steps):
        first = names[1 if is_known.all() else int(np.argmin(is_known))]
        said = f"{where}: the clock stands still or has no time (first at scan {first}); it is not used."
        return TimeOrder(as_given, None, [said])
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.1
    back = np.flatnonzero(steps < 0.0)
    order, warnings = np.argsort(stamps, kind="stable"), []
    ordered = stamps[order]
    if len(back):
        late = int(back[0]) + 1
        how = f"scan {names[late]} is {-steps[late - 1]:.2f} s before the one that comes ahead of it, {names[late - 1]}"
        if unevenness(steps[steps >= 0.0]) + len(back) < unevenness(np.diff(ordered)):
            mended = stamps[0] + np.concatenate([[0.0], np.cumsum(np.where(steps < 0.0, usual, steps))])
            said = f"{where}: the clock jumps back at {len(back)} scans ({how}); it is taken to go on evenly there."
            return TimeOrder(as_given, _apart(mended, usual), [said])
        n_moved = int((order != as_given).sum())
        warnings = [f"{where}: the scans are not in the order of time ({how}); {n_moved} were put in their place."]
    again = np.flatnonzero(np.diff(ordered) == 0.0) + 1
    if len(again):
        first = names[order[again[0]]]
        warnings.append(f"{where}: {len(again)} scans have the time of the one before them (first: {first}).")
    return TimeOrder(order, _apart(ordered, usual), warnings)


def unevenness(steps: Array) -> float:
    """Return by how many usual steps `steps` (N,), >= 0, differ from the usual one, in sum."""
    usual = float(np.median(steps)) if len(steps) else 1.0
    return float(np.abs(steps - usual).sum()) / usual if usual > 0.0 else np.inf


def count_unset(stamps: Array) -> int:
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


def usual_step(stamps: Array | None) -> float | None:
    """Return the seconds that usually lie between scans at `stamps` (N,), in any order; None without a clock."""
    steps = np.zeros(0) if stamps is None else np.diff(np.sort(stamps))
    return float(np.median(steps[steps > 0.0])) if len(steps) > 1 and (steps > 0.0).any() else None


def with_all_times(stamps: Array) -> Array:
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


def _apart(stamps: Array, usual: float) -> Array:
    """Return `stamps` (N,), which do not decrease, with those of one time spread to the next, a usual step at most."""
    values, first, count = np.unique(stamps, return_index=True, return_counts=True)
    room = np.minimum(np.append(np.diff(values), usual), usual)
    which = np.repeat(np.arange(len(values)), count)
    return values[which] + (np.arange(len(stamps)) - first[which]) * (room / count)[which]


_STARTS = (0, 1)
"""Numbers of the first scan before it was renumbered."""
_STEPS = 12
"""Steps of either order, at most, that are compared."""
_MOST_OF = 0.85
"""Share of the difference between the files' neighbours below which the neighbours in another order are the right ones.
It lies midway between a recording in its order (1.2 and more) and one that was renumbered (0.6 and less)."""
_SECTORS, _BANDS = 72, 8
"""Directions around, and bands of elevation, in which ranges are compared."""
_LOWEST, _HIGHEST = -0.6, 0.3
"""Slopes between which the bands lie; what is steeper counts to the last."""
_ENOUGH = 30_000
"""Points of a scan that are looked at."""
_NEAREST = 1.0
"""Metres from the sensor, horizontally, within which a vehicle mostly sees itself."""
_ANOTHER_THING = 0.5
"""Difference of logarithmic ranges from which two things are different ones, however far apart they are."""


def put_in_seen_order(points_of: Callable[[int], Points], names: Sequence[str], where: Path) -> TimeOrder:
    """Return the order of scans without times; as given unless they were clearly renumbered or cannot be read.

    points_of : as for `find_renumbering`; `names` and `where` are for the warning.
    """
    as_given = np.arange(len(names))
    order = None
    with contextlib.suppress(InputError):  # reported when the scan itself is read
        order = find_renumbering(len(names), points_of)
    if order is None:
        return TimeOrder(as_given, None, [])
    moved = np.flatnonzero(order != as_given)
    before, after = names[order[moved[0] - 1]], names[order[moved[0]]]
    warning = (
        f"{where}: the scans seem to be numbered in the alphabetical order of their numbers (by what they saw, scan "
        f"{after} comes after {before}); {len(moved)} were put in their place. If that is wrong, give their times in "
        "times.txt."
    )
    return TimeOrder(order, None, [warning])


def find_renumbering(n: int, points_of: Callable[[int], Points]) -> Ints | None:
    """Return the order in which `n` scans were taken if they were renumbered alphabetically, else None.

    Parameters
    ----------
    points_of : returns the (N, 3) metres of a scan by its number as it is now; asked for some scans only.

    Returns
    -------
    order : (n,) int64, the present numbers of the scans in the order of time.
    """
    looks: dict[int, Array] = {}
    given = np.arange(n)
    best, found = _MOST_OF, None
    for start in _STARTS:
        order = np.argsort(sorted(range(n), key=lambda k: str(k + start)))
        now, then = _steps_of(given), _steps_of(order)
        if now == then:
            continue
        for n_steps in (2, _STEPS):  # two tell most recordings that are in order
            rivals = [evenly_spread(sorted(steps), n_steps) for steps in (now - then, then - now)]
            for scan in {scan for steps in rivals for step in steps for scan in step} - looks.keys():
                looks[scan] = appearance(points_of(scan))
            as_given, reordered = (_mean_difference(looks, steps) for steps in rivals)
            if reordered >= best * as_given:
                break
        if reordered < best * as_given:
            best, found = reordered / as_given, order
    return found


def appearance(points: Points) -> Array:
    """Return (sectors, bands), the mean logarithm of range in each direction around the sensor; NaN where nothing is.

    points : (N, 3) metres, sensor frame.
    """
    x, y, z = points[:: max(len(points) // _ENOUGH, 1)].T
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.hypot(x, y)
        keep = (distance > _NEAREST) & np.isfinite(distance) & np.isfinite(z)
    x, y, z, distance = x[keep], y[keep], z[keep], distance[keep]
    sector = ((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(np.int64) % _SECTORS
    slope = np.clip((z / distance - _LOWEST) / (_HIGHEST - _LOWEST), 0.0, 1.0 - 1e-6)
    cell = sector * _BANDS + (slope * _BANDS).astype(np.int64)
    count = np.bincount(cell, minlength=_SECTORS * _BANDS)
    total = np.bincount(cell, np.log(distance.astype(np.float64)), _SECTORS * _BANDS)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _mean_difference(looks: Mapping[int, Array], steps: Iterable[tuple[int, int]]) -> float:
    """Return how differently the scans of `steps` look, from their `appearance`; NaN where none see the same places."""
    apart = [np.minimum(np.abs(looks[a] - looks[b]), _ANOTHER_THING) for a, b in steps]
    found = [np.nanmean(one) for one in apart if np.isfinite(one).any()]
    return float(np.mean(found)) if found else np.nan


def _steps_of(order: Ints) -> set[tuple[int, int]]:
    return set(zip(order[:-1].tolist(), order[1:].tolist(), strict=True))
