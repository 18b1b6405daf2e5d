"""The columns of records of one size without a header, found from their content.

Coordinates come first, or behind one or two others. Rings are whole numbers that say how steep a ray is, times go on
from point to point or with the direction, and the first of the other numbers that is not negative is the intensity.
"""

from collections.abc import Collection, Sequence
from itertools import product

import numpy as np
import numpy.typing as npt

from automos.core.scan import MIN_RANGE, Array, Mask
from automos.readers.codecs import LAYOUTS, parse_columns, spell_columns
from automos.readers.columns import MAX_SWEEP, find_time_unit, is_measured
from automos.readers.records import SHARE, are_lengths

Rows = npt.NDArray[np.uint8]
"""(N, size) the bytes of records."""

ENOUGH = 1000
"""Records from which their bytes say what they are; of fewer, each is a place of its own."""
_KINDS = ("<f4", "<f8", ">f4", ">f8")
"""Types of coordinates."""
_DRIVERS = (
    "x,y,z,intensity,ring:u2",
    "x,y,z,intensity,ring:u2,time",
    "x,y,z,intensity:u1",
    "x,y,z,intensity:u1,_:u1,line:u1",
    "x,y,z,intensity:u1,_:u1,line:u1,t:u4",
    "x,y,z,intensity,t:u4,_:u2,ring:u2,_:u2",
    "x,y,z,intensity,ring:u2,timestamp:f8",
    "x,y,z,intensity,_:u1,line:u1,timestamp:f8",
)
"""Structs that are no multiple of four bytes, as drivers write them; of one size, those with rings come first."""
_EXPLAINED = 0.9
"""Share of the variance of elevations that rings explain, or directions of times."""
_GOING = 0.95
"""Share of steps in one direction, in what goes on with time."""
_SHORTEST, _TICK = 1e-3, 1e-12
"""Seconds that a sweep lasts, at least, and that no clock tells apart."""
_ALIKE = 0.3
"""Correlation of the coordinates of a point with those of the next."""
_SAME = 0.6
"""Correlation of all coordinates with each other from which they are those of one axis, of points side by side."""
_LINES = 64
"""Beams of sensors whose beams cross, at most."""
_BEAMS = 1024
"""More than any sensor has."""


def columns_of(rows: Rows, kinds: Sequence[str] = _KINDS) -> str | None:
    """Return the columns of (N, size) `rows`, None where their coordinates, of `kinds`, cannot be any."""
    size = rows.shape[1]
    for columns in _DRIVERS:
        dtype = parse_columns(columns)
        if dtype.itemsize == size and _is_of(np.ascontiguousarray(rows).view(dtype)[:, 0]):
            return columns
    for kind, first in product(kinds, range(3)):
        width = int(kind[-1])
        behind = (first + 3) * width
        if size >= behind and (xyz := _coordinates(rows[:, first * width :], kind)) is not None:
            before = _rest_of(rows[:, : first * width], xyz, 0, kind)
            names = {name for name, _ in before}
            after = _rest_of(rows, xyz, behind, kind, names)
            named = [*before, *((axis, kind) for axis in "xyz"), *after]
            fields = [(f"_{i}" if name == "_" else name, form) for i, (name, form) in enumerate(named)]
            columns = spell_columns(np.dtype(fields))
            return LAYOUTS["bin"] if columns == "x,y,z,_" else columns  # of a constant intensity
    return None


def has_numbers(rows: Rows) -> bool:
    """Return whether (N, size) `rows` may begin with three lengths, of any type, or with a time before them."""
    for first, kind in product((0, 8), _KINDS):
        places = rows[:, first : first + 3 * int(kind[-1])]
        if places.shape[1] == 3 * int(kind[-1]) and are_lengths(_first_three(places, kind)):
            return True
    return False


def _first_three(rows: Rows, kind: str) -> Array:
    return np.stack([_field(rows, axis * int(kind[-1]), kind) for axis in range(3)], axis=1).astype(np.float64)


def is_several(rows: Rows, size: int) -> bool:
    """Return whether (N, S) `rows` are several records of `size` bytes: the second goes with the first, or is none.

    Where every so many points are no return, these have places of their own in a larger record.
    """
    for kind in (kind for kind in _KINDS if 3 * int(kind[-1]) <= size):
        points = np.stack([_first_three(rows[:, at:], kind) for at in (0, size)])
        if are_lengths(points):
            first, second = (
                both - both.sum(axis=0) / max(len(both), 1) for both in points[:, np.isfinite(points).all(axis=(0, 2))]
            )
            alike = (first * second).sum(axis=0) / np.sqrt((first**2).sum(axis=0) * (second**2).sum(axis=0))
            return not len(first) or bool((alike > _ALIKE).all())
    return False


def _field(rows: Rows, at: int, kind: str) -> npt.NDArray:
    """Return (N,) the numbers of type `kind` at byte `at` of each row."""
    return np.ascontiguousarray(rows[:, at : at + int(kind[-1])]).view(kind)[:, 0]


def _coordinates(rows: Rows, kind: str) -> Array | None:
    """Return (N, 3) the first three numbers of each row where they can be coordinates, else None."""
    xyz, width = _first_three(rows, kind), int(kind[-1])
    known = xyz[np.isfinite(xyz).all(axis=1) & xyz.any(axis=1)]
    if not are_lengths(xyz) or len(known) == 0:
        return None
    is_whole = (known == np.floor(known)).mean(axis=0) > SHARE
    is_number = is_whole.any() and not is_whole.all()
    is_share = (known.min(axis=0) >= 0.0) & (known.max(axis=0) <= 1.0)  # no sweep lies within a metre
    is_clock = (known.min(axis=0) >= 0.0) | (known.max(axis=0) <= 0.0) | (np.ptp(known, axis=0) <= MAX_SWEEP)
    goes_once = any(is_clock & np.array([_goes_once(values) for values in known.T]))
    are_next = np.corrcoef(known.T).min() > _SAME  # numbers that lie behind one another are of one axis
    is_other = is_number or is_share.any() or not np.ptp(known[:, :2], axis=0).all() or goes_once or are_next
    if not is_other and is_clock[0] and _is_time(known[:, 0], known[:, [1, 2, 2]]):
        is_other = rows.shape[1] >= 4 * width and _coordinates(rows[:, width:], kind) is not None
    return None if is_other and len(known) > ENOUGH else xyz


def _is_of(points: npt.NDArray) -> bool:
    """Return whether (N,) `points` can be of a driver: floats are lengths, rings and times are what they are called."""
    names = points.dtype.names or ()
    xyz = np.stack([points[axis] for axis in "xyz"], axis=1).astype(np.float64)
    is_like = {"time": _is_time, "timestamp": _is_time, "t": _is_time, "ring": _is_ring, "line": _is_line}
    are_floats = all(are_lengths(points[name]) for name in names if points.dtype[name].str == "<f4")
    return are_floats and all(is_like[name](points[name], xyz) for name in names if name in is_like)


def _is_line(values: npt.NDArray, xyz: Array) -> bool:
    """Return whether (N,) `values` may be of beams that cross: bytes of something else are the same, or very many."""
    return 1 < len(np.unique(values)) <= _LINES


def _rest_of(rows: Rows, xyz: Array, at: int, kind: str, taken: Collection[str] = ()) -> list[tuple[str, str]]:
    """Return names, but those `taken`, and types of the columns from byte `at` on; what cannot be told is left out."""
    found: list[tuple[str, str]] = []
    own, order, size = int(kind[-1]), kind[0], rows.shape[1]
    is_packed = size % 4 > 0  # fields of structs without padding begin anywhere
    tried = [(own, "f"), (8, "f"), (8, "u"), (4, "f"), (4, "u"), (2, "u")] + [(1, "u")] * is_packed
    while at < size:
        known = {name for name, _ in found} | {*taken}
        best = nothing = ("_", "V1" if is_packed else "V2")
        if is_packed and "ring" not in known:
            forms = [f"{order}u{width}" for width in (2, 1) if at + width <= size]
            best = next((("ring", form) for form in forms if _is_ring(_field(rows, at, form), xyz)), nothing)
        for width, letter in tried:
            is_aligned = is_packed or at % min(width, 4) == 0
            if is_aligned and at + width <= size and best[0] == "_":
                form = f"{order}{letter}{width}"
                name = _name_of(_field(rows, at, form), form, xyz, known)
                if name is not None and (width <= own or name == "time") and (name != "_" or best == nothing):
                    best = (name, form)
        is_byte = best in (nothing, ("_", f"{order}u1"))
        if is_byte and is_packed and at == 3 * own and (whole := _byte_or_two(rows[:, at:], order)):
            best = ("intensity", whole)  # what drivers write there
        found.append(best)
        at += np.dtype(best[1]).itemsize
    return found


def _byte_or_two(rows: Rows, order: str) -> str | None:
    """Return the type of a whole number at the start of (N, S) `rows`, of one byte or both; None if it never changes.

    Of two bytes the lower one jumps whenever it has gone round: both together go on more evenly.
    """
    if rows.shape[1] == 2:
        both = _field(rows, 0, f"{order}u2")
        upper, lower = both >> 8, both & 0xFF
        is_padded = order == ">" and not upper.any() and np.ptp(lower) > 0
        if is_padded or (np.ptp(upper) and np.ptp(lower) and _likeness(both) > _likeness(lower)):
            return f"{order}u2"
    return f"{order}u1" if np.ptp(rows[:, 0]) else None


def _likeness(values: npt.NDArray) -> float:
    """Return the correlation of (N,) `values` with the next ones."""
    return float(np.corrcoef(values[1:], values[:-1])[0, 1])


def _name_of(values: npt.NDArray, kind: str, xyz: Array, taken: set[str]) -> str | None:
    """Return what a column (N,) beside coordinates `xyz` is; "_": of no known use, None: no column of this type."""
    if kind[1:] == "u8" and np.ptp(values >> 32) > 1:  # of nanoseconds, this counts 4 s
        return None
    if len(np.unique(values)) == 1:
        return "_"
    if "ring" not in taken and _is_ring(values, xyz):
        return "ring"
    if "time" not in taken and _is_time(values, xyz):
        return "time"
    if kind[1] != "f" or not are_lengths(values):
        return None
    if np.isclose(values, np.linalg.norm(xyz, axis=1), rtol=1e-3, atol=0.01).mean() > SHARE:
        return "_"  # the range, which says nothing that x, y and z do not
    return "intensity" if "intensity" not in taken and (values >= 0).mean() > SHARE else "_"


def _is_ring(values: npt.NDArray, xyz: Array) -> bool:
    """Return whether (N,) `values` are few whole numbers that say how steep the rays to `xyz` are."""
    if not ((values == np.floor(values)) & (values >= 0) & (values < _BEAMS)).all():
        return False
    steepness = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
    return _explains(values, steepness, _seen(xyz))


def _is_time(values: npt.NDArray, xyz: Array) -> bool:
    """Return whether (N,) `values` go on from point to point, or with the direction around the sensor."""
    size = np.abs(values[values != 0])
    if not (is_measured(values).all() and float(np.ptp(values)) > _SHORTEST and (size > _TICK).all()):
        return False
    if len(np.unique(values)) < 3 or np.ptp(values) * find_time_unit(values) > MAX_SWEEP:  # a flag; parts of numbers
        return False
    direction = np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0])) + 180.0
    return _goes_on(values) or _explains(direction, values.astype(np.float64), _seen(xyz))


def _seen(xyz: Array) -> Mask:
    return np.isfinite(xyz).all(axis=1) & (np.abs(xyz).max(axis=1) > MIN_RANGE)


def _goes_on(values: npt.NDArray) -> bool:
    """Return whether (N,) `values` hardly ever turn back from one to the next."""
    ahead, behind = (values[1:] > values[:-1]).mean(), (values[1:] < values[:-1]).mean()
    return bool(max(ahead, behind) > 0 and min(ahead, behind) < 1.0 - _GOING and max(ahead, behind) > 0.01)


def _goes_once(values: npt.NDArray) -> bool:
    """Return whether (N,) `values` go on, and not anew again and again, as heights do from beam to beam of a column."""
    there_and_back = np.abs(np.diff(values)).sum() / np.ptp(values) if np.ptp(values) else 0.0
    return bool(there_and_back < np.sqrt(len(values)) and _goes_on(values))


def _explains(groups: npt.NDArray, values: npt.NDArray, counted: Mask) -> bool:
    """Return whether `values` (N,), where `counted`, are much the same within each of several `groups` (N,)."""
    groups, values = groups[counted].astype(np.int64), values[counted]
    if len(values) == 0 or len(np.unique(groups)) < 2:
        return False
    count = np.maximum(np.bincount(groups), 1)
    means = np.bincount(groups, values - values.mean()) / count
    return bool(np.var(values - values.mean() - means[groups]) < (1.0 - _EXPLAINED) * np.var(values))
