"""The log of what a person decided: a line of JSON each, only ever added to.

A decision says which points it is about, as rows of some scans. These belong to the recording: they are the same in
every run, whatever settings, poses or track numbers it has.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.errors import InputError

LOG_FILE = "review.jsonl"
CHOICES = ("moving", "static", "unknown", "undo")
"""What can be decided of a track; "undo" takes back what was decided of it before."""


@dataclass(frozen=True)
class Cover:
    """The points of one scan that a decision is about: how many there were, and the rows of some of them."""

    n_points: int
    rows: list[int]


@dataclass(frozen=True)
class Decision:
    """What was decided, when, of which track of which run, and about which points.

    Attributes
    ----------
    at : time in UTC, ISO 8601.
    track : id as in tracks.json.
    verdict : one of `CHOICES`.
    found : the verdict of the pipeline.
    tracking : fingerprint of the tracks; another one means other tracks under the same ids.
    covers : by the scan's name.
    """

    at: str
    track: int
    verdict: str
    found: str
    tracking: str
    covers: Mapping[str, Cover]

    @property
    def sentence(self) -> str:
        """What was decided, in words."""
        scans = sorted(self.covers)
        where = f" (scans {scans[0]} to {scans[-1]})" if scans else ""
        word = {"unknown": "unsure", "undo": "as found"}.get(self.verdict, self.verdict)
        return f"The decision of {self.at} that object {self.track}{where} is {word}"


def now() -> str:
    """Return the time in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def cover(rows: npt.NDArray[np.int64], most: int = 40) -> Cover:
    """Return the cover of the points in `rows`, keeping at most `most` of them, evenly."""
    kept = rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]
    return Cover(len(rows), [int(row) for row in kept])


def append_decision(folder: Path, decision: Decision) -> None:
    """Add `decision` to the log in `folder`, on disk when this returns.

    Raises
    ------
    InputError
        The log cannot be written.
    """
    line = json.dumps(asdict(decision), separators=(",", ":")) + "\n"
    try:
        with (folder / LOG_FILE).open("ab") as file:
            if file.tell() and not _ends_whole(folder / LOG_FILE):
                file.write(b"\n")  # a line cut short by a crash must not swallow this one
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise InputError(f"{folder / LOG_FILE} cannot be written ({error.strerror}): free some space") from error


def read_decisions(folder: Path) -> list[Decision]:
    """Return the decisions in `folder`, oldest first; none where nobody decided anything.

    Raises
    ------
    InputError
        A line that is no decision. Lines cut short by a crash, without their closing brace, are passed over.
    """
    path = folder / LOG_FILE
    if not path.exists():
        return []
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        if not line.strip().endswith("}"):
            continue
        try:
            fields = json.loads(line)
            covers = {scan: Cover(**one) for scan, one in fields.pop("covers").items()}
            decision = Decision(**fields, covers=covers)
            if decision.verdict not in CHOICES:
                raise ValueError(decision.verdict)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise InputError(f"{path}, line {number} is no decision ({error}); mend or remove that line") from None
        found.append(decision)
    return found


def _ends_whole(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
