"""What one recorder does to what a sensor measured; the plain convention does nothing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any, Literal, get_args, get_type_hints

from automos.core.errors import InputError

Order = Literal["file", "time", "ring", "random"]
Times = Literal["none", "relative", "absolute", "milliseconds", "backwards", "constant", "nan", "too long"]
Reference = Literal["raw", "start", "middle", "end"]


@dataclass(frozen=True)
class Convention:
    """How a recorder keeps a recording.

    Attributes
    ----------
    turns : float
        Turns of the sensor from one cut to the next; 2 merges two sweeps into one scan.
    first_cut : float
        Turns after the recording's start at which its first scan begins.
    order : Order
        Of the points of a scan: as the sweeps have them, by time, beam by beam, or shuffled.
    times : Times
        Of the points, in the files: none, seconds after the scan's first point, seconds since 1970, thousandths of a
        second; or such as are wrong: backwards, all the same, no numbers, twice as long as the scan lasted.
    stamps : bool
        Whether the scans have times (of their middles).
    reference : Reference
        When the sensor was where the points are given from: at each point's own time, or at the scan's start, middle or
        end for all of them, its motion taken out.
    reference_speed : float
        Share of its true motion that was taken out.
    lost_packets : float
        Share of the packets (twelve firings in a row) that never arrived.
    every : int
        Every n-th scan is kept alone, the others never were.
    leave_out : int
        Every n-th scan is missing; 0 for none.
    double : int
        Every n-th scan is there twice; 0 for none.
    renumbered : bool
        Scans in the alphabetical order of their numbers: 0, 1, 10, 11, ..., 2, 20, ...
    unit : float
        Metres per unit of length: 0.01 for centimetres.
    rounding : float
        Metres to which coordinates are rounded; 0 for none.
    beams : int
        Every n-th beam is kept.
    field_of_view : float
        Degrees about straight ahead that are kept.
    lost_sector : float
        Degrees of azimuth that three scans in ten lack.
    specks : float
        Share of points that are something in the air instead: dust, snow, insects.
    """

    turns: float = 1.0
    first_cut: float = 0.0
    order: Order = "file"
    times: Times = "none"
    stamps: bool = True
    reference: Reference = "raw"
    reference_speed: float = 1.0
    lost_packets: float = 0.0
    every: int = 1
    leave_out: int = 0
    double: int = 0
    renumbered: bool = False
    unit: float = 1.0
    rounding: float = 0.0
    beams: int = 1
    field_of_view: float = 360.0
    lost_sector: float = 0.0
    specks: float = 0.0

    def __post_init__(self) -> None:
        hints = get_type_hints(type(self))
        for name in ("order", "times", "reference"):
            known = get_args(hints[name])
            if getattr(self, name) not in known:
                raise InputError(f"{name} is {getattr(self, name)!r}; choose one of: {', '.join(known)}.")
        for name, least, most in _BOUNDS:
            if not least <= getattr(self, name) <= most:
                raise InputError(f"{name} is {getattr(self, name)}; it lies between {least:g} and {most:g}.")

    @classmethod
    def parse(cls, words: Iterable[str]) -> Convention:
        """Return the convention of words like `turns=1.09` or `renumbered=true`.

        Raises
        ------
        InputError
            A word is no `name=value`, the name is unknown, or the value is none of its kind.
        """
        hints, values = get_type_hints(cls), {}
        for word in words:
            name, equals, text = word.partition("=")
            if not equals or name not in hints:
                near = get_close_matches(name, hints, 1)
                hint = f" (did you mean {near[0]}?)" if near else ""
                raise InputError(
                    f"{word!r} is not a convention{hint}; give NAME=VALUE, NAME one of: {', '.join(hints)}."
                )
            values[name] = _value(name, text, hints[name])
        return cls(**values)

    def __str__(self) -> str:
        changed = (f.name for f in fields(self) if getattr(self, f.name) != f.default)
        return ", ".join(f"{name}={getattr(self, name)}" for name in changed) or "plain"


def _value(name: str, text: str, kind: Any) -> Any:
    """Return `text` as a value of `kind`."""
    if kind is bool:
        if text.lower() not in ("true", "false"):
            raise InputError(f"{name} is {text!r}; give true or false.")
        return text.lower() == "true"
    if kind not in (int, float):
        return text
    try:
        return kind(text)
    except ValueError:
        raise InputError(f"{name} is {text!r}; give a {'whole ' if kind is int else ''}number.") from None


_BOUNDS = (
    ("turns", 0.05, 20.0),
    ("first_cut", 0.0, 1e6),
    ("reference_speed", -10.0, 10.0),
    ("lost_packets", 0.0, 1.0),
    ("every", 1, 10**6),
    ("leave_out", 0, 10**6),
    ("double", 0, 10**6),
    ("unit", 1e-6, 1e3),
    ("rounding", 0.0, 10.0),
    ("beams", 1, 1000),
    ("field_of_view", 0.0, 360.0),
    ("lost_sector", 0.0, 360.0),
    ("specks", 0.0, 1.0),
)
