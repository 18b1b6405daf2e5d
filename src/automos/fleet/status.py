"""The progress of a run: the merged ledgers of all processes that work on it."""

import json
import sqlite3
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, Json, TypeAdapter

from automos.core.errors import InputError
from automos.core.reading import checked, require_regular
from automos.fleet.ledger import ledger_folder, missing_shards
from automos.fleet.storage import Store, is_url, join

Count = Annotated[int, Field(ge=0)]


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True)


class _Recording(_Strict):
    """A row of the table `recordings`, as far as it is read and checked."""

    name: str
    state: Literal["waiting", "running", "done", "failed"]
    source: str | None
    fingerprint: str | None
    trace: str | None
    reason: str | None
    scans: Count | None
    points: Count | None
    moving: Count | None
    warnings: Json[list[str]] | None
    fresh: int | None
    seconds: FiniteFloat | None
    cpu_seconds: FiniteFloat | None
    peak_mb: FiniteFloat | None
    ended: FiniteFloat | None


class _Run(_Strict):
    settings_key: str | None
    started: FiniteFloat
    seen: FiniteFloat
    ended: FiniteFloat | None


_ROWS: dict[str, TypeAdapter[Any]] = {
    "recordings": TypeAdapter(list[_Recording]),
    "units": TypeAdapter(list[dict[str, str | int | FiniteFloat | None]], config=ConfigDict(strict=True)),
    "run": TypeAdapter(list[_Run]),
}
"""The tables of a ledger, and the schemas of their rows."""

_SILENT_S = 60.0
"""Seconds without a sign after which whoever worked on a run is taken for dead."""


@dataclass(frozen=True)
class Status:
    """The contents of all ledgers of a run.

    Attributes
    ----------
    recordings : list[dict of str to Any]
        Rows of the table `recordings`, in order of name.
    units : list[dict of str to Any]
        Rows of the table `units`.
    runs : list[dict of str to Any]
        Rows of the table `run`, one for each who deals out work.
    now : float
        Seconds since 1970, when the ledgers were read.
    missing_shards : tuple of str
        Shards, as i/n, that did not begin yet; their recordings are not among those above.
    """

    recordings: list[dict[str, Any]]
    units: list[dict[str, Any]]
    runs: list[dict[str, Any]]
    now: float
    missing_shards: tuple[str, ...] = ()

    def count(self, state: str) -> int:
        """Return how many recordings are waiting, running, done or failed."""
        return sum(row["state"] == state for row in self.recordings)

    @property
    def failures(self) -> list[tuple[str, str]]:
        """Name and reason of every recording that could not be labelled."""
        return [(row["name"], row["reason"] or "") for row in self.recordings if row["state"] == "failed"]

    @property
    def is_at_work(self) -> bool:
        """Whether a process works on the run."""
        return any(run["ended"] is None and self.now - run["seen"] < _SILENT_S for run in self.runs)

    @property
    def rate(self) -> float:
        """Recordings per hour, of those labelled since the run was last started; 0 if none was."""
        start = min((run["started"] for run in self.runs), default=self.now)
        fresh = [row["ended"] for row in self.recordings if row["state"] == "done" and row["fresh"]]
        recent = [ended for ended in fresh if ended >= start]
        end = self.now if self.is_at_work else max(recent, default=self.now)
        return 3600.0 * len(recent) / max(end - start, 1e-3) if recent else 0.0

    @property
    def seconds_left(self) -> float | None:
        """Seconds until all is done at this rate; None if there is none."""
        left = self.count("waiting") + self.count("running")
        return 3600.0 * left / self.rate if self.rate else None

    def to_json(self) -> str:
        """Return the contents of the ledgers and the figures derived from them."""
        counts = {state: self.count(state) for state in ("done", "running", "waiting", "failed")}
        rate = {"recordings_per_hour": self.rate, "seconds_left": self.seconds_left, "is_at_work": self.is_at_work}
        tables = {"recordings": self.recordings, "units": self.units, "runs": self.runs}
        return json.dumps({**counts, **rate, "missing_shards": self.missing_shards, **tables}, indent=1)

    def lines(self) -> list[str]:
        """Return the status in lines for a terminal."""
        done = [row for row in self.recordings if row["state"] == "done"]
        scans = sum(row["scans"] or 0 for row in done)
        fresh = [row for row in done if row["seconds"]]
        lines = [
            f"{len(done)} of {len(self.recordings)} recordings labelled, {self.count('running')} running, "
            f"{self.count('waiting')} waiting, {self.count('failed')} failed",
            f"{scans:,} scans, {sum(row['points'] or 0 for row in done):,} points, "
            f"{sum(row['moving'] or 0 for row in done):,} moving",
        ]
        fresh_scans = sum(row["scans"] for row in fresh)
        if fresh_scans:
            cpu, peak = sum(row["cpu_seconds"] for row in fresh), max(row["peak_mb"] for row in fresh)
            lines.append(f"{cpu / fresh_scans:.3f} CPU s per scan, workers of at most {peak:,.0f} MB")
        if self.is_at_work:
            left = self.seconds_left
            lines.append(f"{self.rate:.1f} recordings per hour, {'?' if left is None else _duration(left)} left")
        elif self.count("waiting") + self.count("running"):
            lines.append("no process is working on it: repeat the command to do what is missing")
        if self.missing_shards:
            few = ", ".join(self.missing_shards[:4]) + (", ..." if len(self.missing_shards) > 4 else "")
            lines.append(f"not begun, and not counted above: {len(self.missing_shards)} shards ({few})")
        warned = [row for row in done if json.loads(row["warnings"] or "[]")]
        lines += [f"warning: {row['name']}: {text}" for row in warned for text in json.loads(row["warnings"])]
        lines += [f"not labelled: {name}: {reason}" for name, reason in self.failures]
        return [" ".join(line.splitlines()) for line in lines]


def read_status(target: str) -> Status:
    """Return the status of the run at `target` (path or URL).

    Raises
    ------
    InputError : there is no run.
    """
    tables: dict[str, list[dict[str, Any]]] = {table: [] for table in _ROWS}
    with _books_of(target) as paths:
        if not paths:
            raise InputError(
                f"{target} holds no run of automos label over several recordings; of one, automos report tells"
            )
        for path in paths:
            try:
                for table, rows in _read_books(path).items():
                    tables[table] += rows
            except (sqlite3.Error, ValueError) as error:
                raise InputError(f"{path} is damaged ({error}): delete it and run automos label again") from None
        shards = missing_shards(path.name for path in paths)
    return Status(_merged(tables["recordings"]), tables["units"], tables["run"], time.time(), tuple(shards))


def _read_books(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of all tables; ValueError or sqlite3.Error if it is not a ledger."""
    require_regular(path)
    books = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, timeout=30.0)
    try:
        books.row_factory = sqlite3.Row
        kinds = {row["name"]: row["type"] for row in books.execute("SELECT name, type FROM sqlite_master")}
        if any(kinds.get(table) != "table" for table in _ROWS):  # a view may have rows without end
            raise ValueError(f"it has not the tables {', '.join(_ROWS)}")
        tables = {table: [dict(row) for row in books.execute(f"SELECT * FROM {table}")] for table in _ROWS}
    finally:
        books.close()
    for table, rows in tables.items():
        checked(_ROWS[table], rows)
    return tables


def _merged(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return one row for each recording, in order of name: if several ledgers have it, the most advanced state."""
    states, best = ("done", "running", "failed", "waiting"), dict[str, dict[str, Any]]()
    for row in sorted(rows, key=lambda row: states.index(row["state"])):
        best.setdefault(row["name"], row)
    return [best[name] for name in sorted(best)]


@contextmanager
def _books_of(target: str) -> Iterator[list[Path]]:
    folder = ledger_folder(target)
    if not is_url(target):
        yield sorted(Path(folder).glob("*.sqlite"))
        return
    with tempfile.TemporaryDirectory() as copies:
        store = Store(folder)
        for name in [entry.path for entry in store.entries() if entry.path.endswith(".sqlite")]:
            store.get(name, join(copies, name))
        yield sorted(Path(copies).iterdir())


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    if minutes < 1:
        return f"{seconds:.0f} s"
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
