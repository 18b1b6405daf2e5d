"""What the points' own times are good for: their unit, whether they are of one clock for all scans, or of no use.

Drivers write seconds, milli-, micro- or nanoseconds, after the scan's first point, since 1970 or since the sensor was
switched on. Times that cannot be are not used, and that is said once.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from automos.core.arrays import Array
from automos.readers.column_names import has_time
from automos.readers.columns import MAX_SWEEP, Columns, find_time_unit, is_measured, time_column, whole_column
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


def sweep_bounds(times: np.ndarray, unit: float) -> tuple[float, float]:
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
    others: Array | None,
) -> Array:
    """Return (N,) seconds at which the sweeps in the files at `paths` begin; `others` if too few have any times."""

    def start(path: Path) -> float:
        times = time_column(read(path))
        return np.nan if times is None or about.unit is None else sweep_bounds(times, about.unit)[0]

    with ThreadPoolExecutor() as pool:
        times = with_all_times(np.array(list(pool.map(start, paths))))
    return times if others is None or np.isfinite(times).all() else others


def _share_backwards(columns: Columns) -> float:
    """Return the share of steps in time, from a point to the next of its beam in the file, that go back."""
    times, ring = time_column(columns), whole_column(columns, "ring")
    if times is None:
        return 0.0
    beam = np.zeros(len(times), np.uint16) if ring is None else ring
    order = np.argsort(beam, kind="stable")
    after, before = times[order][1:], times[order][:-1]
    is_step = (np.diff(beam[order]) == 0) & np.isfinite(after) & np.isfinite(before) & (after != before)
    return float((after < before)[is_step].mean()) if is_step.any() else 0.0
