"""Decisions of a person on the tracks of a run, as lines of the log."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, TypeAdapter

from automos.core.reading import checked
from automos.review.log import append_lines, read_lines

CHOICES = ("moving", "static", "unknown", "undo")
"""What can be decided of a track; "undo" takes back what was decided of it before."""


MOST_POINTS = 1 << 40
"""Of a scan; what is beyond is damage."""


@dataclass(frozen=True)
class Cover:
    """The points of one scan that a decision is about: how many there were, and the rows of some of them."""

    n_points: Annotated[int, Field(ge=0, le=MOST_POINTS)]
    rows: list[Annotated[int, Field(ge=0, le=MOST_POINTS)]]


@dataclass(frozen=True)
class Decision:
    """What was decided, when, of which track of which run, and about which points.

    Attributes
    ----------
    at : str
        Time in UTC, ISO 8601.
    track : int
        Id as in tracks.json.
    verdict : str
        One of `CHOICES`.
    found : str
        The verdict of the pipeline.
    tracking : str
        Fingerprint of the tracks; another one means other tracks under the same ids.
    covers : dict of str to Cover
        By the scan's name.
    """

    at: str
    track: int
    verdict: str
    found: str
    tracking: str
    covers: dict[str, Cover]

    @property
    def sentence(self) -> str:
        """What was decided, in words."""
        scans = sorted(self.covers)
        where = f" (scans {scans[0]} to {scans[-1]})" if scans else ""
        word = {"unknown": "unsure", "undo": "as found"}.get(self.verdict, self.verdict)
        return f"The decision of {self.at} that object {self.track}{where} is {word}"


_DECISION = TypeAdapter(Decision)


def cover(rows: npt.NDArray[np.int64], most: int = 40) -> Cover:
    """Return the cover of the points in `rows`, keeping at most `most` of them, evenly."""
    kept = rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]
    return Cover(len(rows), [int(row) for row in kept])


def append_decisions(folder: Path, decisions: Iterable[Decision]) -> None:
    """Add `decisions` to the log in `folder`, on disk when this returns; errors as for the log."""
    append_lines(folder, [asdict(decision) for decision in decisions])


def read_decisions(folder: Path) -> list[Decision]:
    """Return the decisions in `folder`, oldest first; none if nobody decided anything; errors as of the log."""
    return read_lines(folder, None, "a decision", _parse)


def _parse(fields: dict[str, Any]) -> Decision:
    decision = checked(_DECISION, fields)
    if decision.verdict not in CHOICES:
        raise ValueError(decision.verdict)
    return decision
