"""What one recorder does to what a sensor measured; the plain convention does nothing."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from automos.core.errors import InputError

Order = Literal["file", "time", "ring", "random"]
Times = Literal["none", "relative", "absolute", "milliseconds", "backwards", "constant", "nan", "too long"]
Reference = Literal["raw", "start", "middle", "end"]


class Convention(BaseModel):
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

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    turns: float = Field(1.0, ge=0.05, le=20.0)
    first_cut: float = Field(0.0, ge=0.0, le=1e6)
    order: Order = "file"
    times: Times = "none"
    stamps: bool = True
    reference: Reference = "raw"
    reference_speed: float = Field(1.0, ge=-10.0, le=10.0)
    lost_packets: float = Field(0.0, ge=0.0, le=1.0)
    every: int = Field(1, ge=1, le=10**6)
    leave_out: int = Field(0, ge=0, le=10**6)
    double: int = Field(0, ge=0, le=10**6)
    renumbered: bool = False
    unit: float = Field(1.0, ge=1e-6, le=1e3)
    rounding: float = Field(0.0, ge=0.0, le=10.0)
    beams: int = Field(1, ge=1, le=1000)
    field_of_view: float = Field(360.0, ge=0.0, le=360.0)
    lost_sector: float = Field(0.0, ge=0.0, le=360.0)
    specks: float = Field(0.0, ge=0.0, le=1.0)

    def __init__(self, **values: Any):
        """Take what differs from the plain convention; InputError where it is not possible."""
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise InputError(_sentence(error)) from None

    @classmethod
    def parse(cls, words: Iterable[str]) -> Convention:
        """Return the convention of words like `turns=1.09` or `renumbered=true`.

        Raises
        ------
        InputError
            A word is no `name=value`, the name is unknown, or the value is none of its kind.
        """
        return cls(**{name: text for name, _, text in (word.partition("=") for word in words)})

    def __str__(self) -> str:
        changed = ((name, value) for name, value in self if value != type(self).model_fields[name].default)
        return ", ".join(f"{name}={value}" for name, value in changed) or "plain"


def _sentence(error: ValidationError) -> str:
    """Return the first problem of `error` as a sentence."""
    problem = error.errors()[0]
    name, known = str(problem["loc"][0]), Convention.model_fields
    if problem["type"] != "extra_forbidden":
        return f"{name} is {problem['input']!r}: {problem['msg'][:1].lower()}{problem['msg'][1:]}."
    near = get_close_matches(name, known, 1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"{name!r} is not a convention{hint}; give NAME=VALUE, NAME one of: {', '.join(known)}."
