"""Renumbered scans without any times, recognised by what they saw.

A copy whose scans were numbered anew in the alphabetical order of their numbers (0, 1, 10, 11, ..., 2, 20, ...) jumps
about in a fifth of its steps. Scans that follow each other look alike: where the steps that only the right order has
join scans that are clearly more alike than those that only the files' order has, the copy is put in order. A handful of
these steps decides, so that opening a long recording costs no more than opening a short one.
"""

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.scan import Points
from automos.readers.time_order import TimeOrder

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


def find_renumbering(n: int, points_of: Callable[[int], Points]) -> npt.NDArray[np.int64] | None:
    """Return the order in which `n` scans were taken if they were renumbered alphabetically, else None.

    Parameters
    ----------
    points_of : returns the (N, 3) metres of a scan by its number as it is now; asked for some scans only.

    Returns
    -------
    order : (n,) int64, the present numbers of the scans in the order of time.
    """
    looks: dict[int, npt.NDArray[np.float64]] = {}
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


def appearance(points: Points) -> npt.NDArray[np.float64]:
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


def difference(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    """Return how differently two scans look, from their `appearance`; NaN where no direction is seen in both."""
    apart = np.minimum(np.abs(a - b), _ANOTHER_THING)
    return float(np.nanmean(apart)) if np.isfinite(apart).any() else np.nan


def _mean_difference(looks: Mapping[int, npt.NDArray[np.float64]], steps: Iterable[tuple[int, int]]) -> float:
    found = np.array([difference(looks[a], looks[b]) for a, b in steps])
    found = found[np.isfinite(found)]
    return float(found.mean()) if len(found) else np.nan


def _steps_of(order: npt.NDArray[np.int64]) -> set[tuple[int, int]]:
    return set(zip(order[:-1].tolist(), order[1:].tolist(), strict=True))
