"""Named columns of a point file, whatever wrote it, made into a scan.

Drivers agree on x, y, z and on little else. Names are compared without case; a column that is absent, constant (time)
or not what its name says (a ring that is not a whole number) becomes None rather than a guess.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.scan import MAX_RANGE, Array, Mask, Points, Pose, Scan
from automos.readers.column_names import by_plain_names, called, parts_of_clock, plain_names

Columns = dict[str, npt.NDArray]

UNNAMED = ("x", "y", "z", "intensity", "ring")
"""Columns of arrays and tables that do not name them."""
MAX_COLUMNS = 100
"""Numbers a point may have: a wider array has its points side by side."""

MAX_FIELDS = 1 << 12
"""Names that a header may give to the numbers of a point; the largest have hundreds."""

_LAST_TIME = 2.0**64
"""Nanoseconds, the smallest unit: no clock counts further."""

MAX_SWEEP = 2.0
"""Seconds. No sensor takes longer for one sweep: times that span more are counted in a smaller unit."""


def to_scan(
    columns: Columns,
    path: Path,
    name: str = "",
    stamp: float | None = None,
    time_unit: float | None = None,
    unit: float = 1.0,
    T_file_sensor: Pose | None = None,
) -> Scan:
    """Return the scan that `columns` hold, in their order.

    Parameters
    ----------
    columns : each (N,), any numeric type; x, y, z in the sensor frame.
    path : the file they came from, for messages.
    name, stamp : the scan's.
    time_unit : seconds per count of the time column, 0 where it is not to be used; none: found from the span of this
        scan's times.
    unit : metres per unit of the coordinates.
    T_file_sensor : (4, 4) where the sensor was in the frame of the coordinates; none: that is its own.

    Raises
    ------
    InputError
        If x, y or z is missing.
    """
    columns = by_plain_names(columns, path)
    points = _coordinates(columns, path, np.float32 if T_file_sensor is None else np.float64)
    columns = _numbers(columns)
    if (frame := _first(columns, "frame")) is not None and len(np.unique(frame)) > 1:
        raise InputError(f"{path} holds the points of {len(np.unique(frame))} scans; write a file for each")
    if unit != 1.0:
        points *= points.dtype.type(unit)
    if T_file_sensor is not None:  # numbers of a map are beyond what float32 holds to the centimetre
        points = transform(inverse(T_file_sensor), points).astype(np.float32)
    _refuse_map(points, path)
    intensity = _first(columns, "intensity")
    return Scan(
        points,
        intensity=None if intensity is None else np.ascontiguousarray(intensity, np.float32),
        time=None if time_unit == 0.0 else _seconds(time_column(columns), time_unit),
        ring=_ring(_first(columns, "ring")),
        stamp=stamp,
        name=name,
    )


def coordinates(columns: Columns, path: Path) -> Array:
    """Return the (N, 3) coordinates among `columns`, in the file's unit and frame; errors are those of `to_scan`."""
    return _coordinates(by_plain_names(columns, path), path, np.float64)


def _coordinates(columns: Columns, path: Path, dtype: type[np.floating]) -> npt.NDArray:
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        raise InputError(
            f"{path} has no column {', '.join(missing)}; its columns are: {', '.join(columns) or 'none'}; call the "
            "coordinates x, y and z, in a file of text with --columns"
        )
    stray = next((axis for axis in "xyz" if columns[axis].dtype.kind not in "fiu"), None)
    if stray is not None:
        raise InputError(f"{path} holds {columns[stray].dtype} as {stray}; coordinates are real numbers")
    points = np.empty((len(columns["x"]), 3), dtype)
    with np.errstate(over="ignore", invalid="ignore"):  # beyond what float32 holds is beyond what any sensor sees
        for i, axis in enumerate("xyz"):
            points[:, i] = columns[axis]
    return points


@np.errstate(invalid="ignore")  # a NaN that signals is one
def _refuse_map(points: Points, path: Path) -> None:
    """Raise where most of `points` lie beyond any sensor's range: what moves is seen from where the sensor was."""
    few = points[:: max(len(points) // 64, 1)]
    is_point = np.isfinite(few).all(axis=1) & few.any(axis=1)
    is_far = (np.abs(few) > MAX_RANGE).any(axis=1)
    if 2 * int((is_far & is_point).sum()) > int(is_point.sum()):
        x, y, _ = few[is_far & is_point][0]
        raise InputError(f"{path} has coordinates of a map ({x:.0f}, {y:.0f}); give sweeps in the sensor's frame")


def from_matrix(matrix: npt.NDArray, path: Path, names: Sequence[str] = UNNAMED) -> Columns:
    """Return the columns of an (N, C >= 3) array.

    `names` are the columns', as many as there are where others than `UNNAMED` are given; further ones are not used, nor
    is the fifth of more than five: colours and normals come there.
    """
    if matrix.ndim != 2 or not 3 <= matrix.shape[1] <= MAX_COLUMNS:
        raise InputError(
            f"{path} holds an array of shape {matrix.shape}; points are (N, 3) or wider: x y z intensity ring"
        )
    if names is not UNNAMED and len(names) != matrix.shape[1]:
        raise InputError(f"{path} has {matrix.shape[1]} columns, and --columns names {len(names)}: {','.join(names)}")
    some = names[:4] if names is UNNAMED and matrix.shape[1] > len(UNNAMED) else names[: matrix.shape[1]]
    return {name: matrix[:, i] for i, name in enumerate(some)}


def time_column(columns: Columns) -> npt.NDArray | None:
    """Return the first column named as a time whose values differ, else None; nanoseconds of a clock in two parts."""
    numbers = _numbers(columns)
    if parts := parts_of_clock(numbers):
        whole, rest = (np.nan_to_num(numbers[name]) for name in parts)
        is_whole = np.array_equal(whole, np.floor(whole)) and np.abs(whole).max(initial=0) < 2**33
        if is_whole and 0 <= rest.min(initial=0) < rest.max(initial=0) < 1e9:
            return whole.astype(np.int64) * 10**9 + rest.astype(np.int64)
    known = (numbers[name] for name in called(numbers, "time"))
    # int16 of either sign may not hold the difference of two of them
    known = (times.astype(np.int64, copy=False) if times.dtype.kind == "i" else times for times in known)
    return next((times for times in known if _span(times) > 0), None)


def whole_column(columns: Columns, meaning: str) -> npt.NDArray[np.uint16] | None:
    """Return (N,) the "ring" of each point, or the "sensor" it is from; None where no column of whole numbers is."""
    return _ring(_first(_numbers(columns), meaning))


def find_time_unit(times: npt.NDArray) -> float:
    """Return the seconds per count (1, 1e-3, 1e-6 or 1e-9) in which `times` (N,) of one sweep last at most MAX_SWEEP.

    Units are a thousand apart, so any sweep of more than 2 ms, up to 2 s, has one answer; names and types say less (a
    `timestamp` may be seconds or nanoseconds, a float or an integer).
    """
    span = _span(times)
    return next((unit for unit in (1.0, 1e-3, 1e-6) if span * unit <= MAX_SWEEP), 1e-9)


def _numbers(columns: Columns) -> Columns:
    """Return by plain names what is numbers: dates and texts, which tables hold beside points, are of no use."""
    numbers = {name: column for name, column in columns.items() if column.dtype.kind in "fiu"}
    return dict(zip(plain_names(list(numbers)), numbers.values(), strict=True))


def _first(columns: Columns, meaning: str) -> npt.NDArray | None:
    return next((columns[name] for name in called(columns, meaning)), None)


def is_measured(times: npt.NDArray) -> Mask:
    """Return (N,) bool: which points have a time.

    NaN is none, nor is what 64 bits of nanoseconds do not reach, nor 0 where the clock began long before the sweep.
    """
    is_finite = (times > -_LAST_TIME) & (times < _LAST_TIME)
    is_later = is_finite & (times > 0)
    later = times[is_later]
    has_zeros = 2 < len(later) < is_finite.sum()
    return is_later if has_zeros and 0 < later.max() - later.min() < 0.1 * later.min() else is_finite


def _span(times: npt.NDArray) -> float:
    known = times[is_measured(times)]
    # Subtract in the file's own type: nanoseconds since 1970 are beyond float64's whole numbers.
    return float(known.max() - known.min()) if len(known) else 0.0


def _seconds(times: npt.NDArray | None, unit: float | None) -> npt.NDArray[np.float32] | None:
    """Return (N,) seconds after the first point; where the file has no finite time, those of the points beside it."""
    if times is None:
        return None
    is_known = is_measured(times)
    seconds = (times[is_known] - times[is_known].min()) * (find_time_unit(times) if unit is None else unit)
    if not is_known.all():
        seconds = np.interp(np.arange(len(times)), np.flatnonzero(is_known), seconds)
    return seconds.astype(np.float32)


def _ring(values: npt.NDArray | None) -> npt.NDArray[np.uint16] | None:
    if values is None:
        return None
    with np.errstate(invalid="ignore"):
        ring = values.astype(np.uint16)
    return ring if np.array_equal(ring, values) else None
