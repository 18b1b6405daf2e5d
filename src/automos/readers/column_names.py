"""What columns of points are called, whatever wrote them: plain names, and the units that come with them."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy.typing as npt

from automos.core.errors import InputError

_NUMBER = "id|ids|index|idx|number|num|no|nr"
_UNITS = "(n|u|m|nano|micro|milli)?s(ec|ecs|econds?)?"
_MEANINGS = {
    "time": (
        "t|time|times|timestamp|timestamps|stamp|stamps|tstamp|dt|offset",
        f"point|pts|raw|rel|relative|adjusted|gps|utc|unix|offset|delta|scan|sensor|device|host|from|since|start|{_UNITS}",
    ),
    "intensity": (
        "intensity|i|intens|reflectivity|reflectance|refl|remission|signal|amplitude|grayscale|greyscale",
        "raw|return|photons|calibrated|corrected|normali[sz]ed|laser|lidar|point|value",
    ),
    "ring": (
        "ring|line|channel|beam|laser|layer|scanline|row",
        f"laser|lidar|sensor|scan|vertical|{_NUMBER}",
    ),
    "sensor": ("sensor|lidar", _NUMBER),
    "frame": ("frame|sweep", _NUMBER),
}
"""What columns are called, the first before others, and words around that, which change nothing."""
_NAMED = {
    meaning: re.compile(f"({around}){{0,4}}?(?P<word>{words})({around}){{0,4}}")
    for meaning, (words, around) in _MEANINGS.items()
}
_NANOSECONDS, _SECONDS = re.compile(r"(.*?)[._]?n(ano)?s(ec(ond)?s?)?"), r"[._]?s(ec(ond)?s?)?"
_AROUND_AXES = re.compile(r"points?|pos(ition)?|coord(s|inates?)?|xyz|lidar|sensor|local|[ckm]?m")
_METRES = {"km": 1000.0, "cm": 0.01, "mm": 0.001}
_METRIC = re.compile(r"(?:[(\[{]\s*|_)([ckm]m)(?:\s*[)\]}]|_|$)")
"""How many metres are in what a name says behind it: x [mm], x_mm."""
_NOT_METRIC = re.compile(r"[(\[{]\s*(us[- ]?)?(ft|feet|foot|in|inch|inches|yd|yards?)\s*[)\]}]\s*$")
_UNIT = re.compile(r"[(\[{][^()\[\]{}]*[)\]}]\s*$")
"""What stands behind a name in brackets."""


def by_plain_names(columns: dict[str, npt.NDArray], path: Path) -> dict[str, npt.NDArray]:
    """Return `columns` by their plain names, coordinates in metres.

    Raises
    ------
    InputError
        Coordinates are in another unit, or there twice.
    """
    plain = plain_names(list(columns))
    axes = [key for key, name in zip(columns, plain, strict=True) if name in ("x", "y", "z")]
    if other := list(filter(_NOT_METRIC.search, axes)):
        raise InputError(f"{path} has coordinates in another unit than metres ({other[0]}); export it again in metres")
    twice = next((axis for axis in "xyz" if plain.count(axis) > 1), None)
    if twice is not None:
        both = ", ".join(key for key, name in zip(columns, plain, strict=True) if name == twice)
        raise InputError(f"{path} has {twice} twice ({both}); export it again with the one that is meant")
    units = {key: _METRES[unit[1]] for key in axes if (unit := _METRIC.search(key.lower()))}
    in_metres = (column * units[key] if key in units else column for key, column in columns.items())
    return dict(zip(plain, in_metres, strict=True))


def plain_names(names: Sequence[str]) -> list[str]:
    """Return what columns are called, without case, blanks, units and words around an axis: `Points_m_XYZ:0` is x.

    What stands before all three axes alike is left out before the others, too.
    """
    plain = [_plain(name) for name in names]
    if {"x1", "y1", "z1"} <= {*plain} and "x" not in plain:  # of the first of two returns
        plain = [name[0] if name in ("x1", "y1", "z1") else name for name in plain]
    there = {*plain}  # a damaged header may name very many
    before = {name[:-1] for name in there if {name[:-1] + axis for axis in "xyz"} <= there}
    if len(before) == 1:
        plain = [name.removeprefix(*before) or name for name in plain]
    for i, name in enumerate(plain):
        words = [word for word in name.split("_") if word]
        left = [word for word in words if not _AROUND_AXES.fullmatch(word)]
        axis = "xyz"["012".index(left[0])] if left in (["0"], ["1"], ["2"]) and left != words else "".join(left)
        if axis in ("x", "y", "z") and axis not in plain:  # one that is called so alone comes first
            plain[i] = axis
    return plain


def called(names: Iterable[str], meaning: str) -> list[str]:
    """Return those of some plain `names` that mean a time, an intensity, a ring, a sensor or a frame, the usual first.

    Examples
    --------
    >>> called(["laser_id", "point_time_offset", "timestamp", "gain"], "time")
    ['timestamp', 'point_time_offset']
    """
    found = []
    for name in names:
        if match := _NAMED[meaning].fullmatch(bare := name.replace("_", "")):
            found.append((match["word"] != bare, _MEANINGS[meaning][0].split("|").index(match["word"]), name))
    return [name for *_, name in sorted(found)]


def is_time(name: str) -> bool:
    """Return whether a column of this name is one of times."""
    return bool(called([_plain(name)], "time"))


def has_time(names: Iterable[str]) -> bool:
    """Return whether any column is named as a time."""
    return bool(called(plain_names(list(names)), "time"))


def parts_of_clock(names: Iterable[str]) -> tuple[str, str] | None:
    """Return which of some `names` are a clock's seconds and its nanoseconds, None if none are both."""
    for name in (names := list(names)):
        if (parts := _NANOSECONDS.fullmatch(name)) and (
            whole := next(filter(re.compile(re.escape(parts[1]) + _SECONDS).fullmatch, names), None)
        ):
            return whole, name
    return None


def _plain(name: str) -> str:
    return re.sub(r"[^\w]+", "_", _UNIT.sub("", name.lower())).strip("_").removeprefix("scalar_")  # CloudCompare's
