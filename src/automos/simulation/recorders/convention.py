"""What one recorder does to what a sensor measured, and to which points; the plain convention does nothing."""

from collections.abc import Iterable
from dataclasses import replace
from difflib import get_close_matches
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.scan import Scan

Order = Literal["file", "time", "ring", "random"]
Times = Literal["none", "relative", "absolute", "milliseconds", "backwards", "constant", "nan", "too long"]
Reference = Literal["raw", "start", "middle", "end"]

Rows = npt.NDArray[np.int64]

PACKETS = 150
"""A turn's."""
FAULTY_SCANS = 0.3
"""Share of scans that lack a sector, where some do."""
SPECK_RANGE = (1.0, 20.0)
"""Metres from the sensor at which specks fly."""
_COLUMNS = ("points", "intensity", "time", "ring", "sensor")


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
    def parse(cls, words: Iterable[str]) -> Self:
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

    def kept_cuts(self, n_cuts: int) -> Rows:
        """Return the numbers of the cuts that are kept as scans, in the order in which they are kept."""
        cuts = np.arange(0, n_cuts, self.every)
        if self.leave_out:
            cuts = cuts[(np.arange(len(cuts)) + 1) % self.leave_out != 0]
        if self.double:
            cuts = np.repeat(cuts, np.where((np.arange(len(cuts)) + 1) % self.double == 0, 2, 1))
        if self.renumbered:
            cuts = cuts[sorted(range(len(cuts)), key=str)]
        return cuts

    def kept_rows(self, scan: Scan, when: npt.NDArray[np.float64], rng: np.random.Generator) -> Rows:
        """Return the rows of `scan` that are kept, in the order in which they are.

        when : (N,) turns at which they were measured.
        """
        keep = np.ones(len(scan), bool)
        if self.lost_packets:
            packet = ((when - when.min(initial=0.0)) * PACKETS).astype(np.int64)
            keep &= rng.random(packet.max(initial=0) + 1)[packet] >= self.lost_packets
        if self.beams > 1 and scan.ring is not None:
            keep &= scan.ring % self.beams == 0
        azimuth = np.degrees(np.arctan2(scan.points[:, 1], scan.points[:, 0]))
        keep &= np.abs(azimuth) <= 0.5 * self.field_of_view
        if self.lost_sector and rng.random() < FAULTY_SCANS:
            keep &= (azimuth - rng.uniform(0.0, 360.0)) % 360.0 >= self.lost_sector
        rows = np.flatnonzero(keep)
        if self.order == "random":
            return rng.permutation(rows)
        if self.order == "time":
            return rows[np.argsort(when[rows], kind="stable")]
        if self.order == "ring" and scan.ring is not None:
            return rows[np.lexsort((when[rows], scan.ring[rows]))]
        return rows

    def times_in_file(self, clock: npt.NDArray[np.float64]) -> npt.NDArray[np.float32] | None:
        """Return what a reader takes for the times (N,) of points, from the scan's first on.

        clock : (N,) seconds at which they were measured.
        """
        if self.times == "none" or len(clock) == 0:
            return None
        seconds = clock - clock.min()
        wrong = {
            "backwards": seconds.max() - seconds,
            "constant": np.zeros_like(seconds),
            "nan": np.full_like(seconds, np.nan),
            "too long": 2.0 * seconds,
        }
        return wrong.get(self.times, seconds).astype(np.float32)


def _sentence(error: ValidationError) -> str:
    """Return the first problem of `error` as a sentence."""
    problem = error.errors()[0]
    name, known = str(problem["loc"][0]), Convention.model_fields
    if problem["type"] != "extra_forbidden":
        return f"{name} is {problem['input']!r}: {problem['msg'][:1].lower()}{problem['msg'][1:]}."
    return f"{name!r} is not a convention{hint(name, known)}; give NAME=VALUE, NAME one of: {', '.join(known)}."


def hint(name: str, known: Iterable[str]) -> str:
    """Return what somebody may have meant who wrote `name`, in parentheses; nothing where nothing is near."""
    near = get_close_matches(name, list(known), 1)
    return f" (did you mean {near[0]}?)" if near else ""


def with_specks(points, truth, share, rng):  # type: ignore[no-untyped-def]
    """Return points and labels with a share of the points somewhere in the air on their rays, nearer; static."""
    distance = np.linalg.norm(points, axis=1)
    rows = np.flatnonzero((rng.random(len(points)) < share) & (distance > SPECK_RANGE[0]))
    near = rng.uniform(SPECK_RANGE[0], np.minimum(distance[rows], SPECK_RANGE[1]))
    points = points.copy()
    points[rows] *= (near / distance[rows])[:, None].astype(points.dtype)
    if truth is not None:
        truth = truth.copy()
        truth[rows] = Label.STATIC
    return points, truth


def rows_of(scan: Scan, rows: Rows) -> Scan:
    """Return the scan of some points of `scan`, in the order of `rows`."""
    given = {name: getattr(scan, name) for name in _COLUMNS}
    columns: dict[str, Any] = {name: None if column is None else column[rows] for name, column in given.items()}
    return replace(scan, **columns)


def joined(scans: list[Scan]) -> Scan:
    """Return the first of the scans with the points of all, one after the other."""

    def column(name: str) -> npt.NDArray | None:
        parts = [getattr(scan, name) for scan in scans]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    columns: dict[str, Any] = {name: column(name) for name in _COLUMNS}
    return replace(scans[0], **columns)
