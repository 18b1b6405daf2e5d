"""The ledger of a run: an SQLite file with every recording and unit of work, its state, cost and result.

Only the process that deals out the work writes, a few rows a second, so a plain rollback journal is enough, and unlike
a write-ahead log it can be read from other machines that share the disk. Array jobs keep a file each; readers merge
them. The ledger is an account, not the truth: what is labelled is known from the results themselves. So a full disk
makes the account incomplete, which is warned of, and never stops the work.
"""

import json
import logging
import re
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from automos.core.claims import LEDGER, claim
from automos.core.errors import InputError
from automos.fleet.orders import Order, Recording, Report
from automos.fleet.storage import Store, join, shown

_log = logging.getLogger(__name__)
_SAVE_EVERY_S = 30.0
_SHARD = re.compile(r"shard-(\d+)-of-(\d+)\.sqlite")

_TABLES = """
CREATE TABLE IF NOT EXISTS run (
  settings_key TEXT, settings TEXT, versions TEXT, started REAL, seen REAL, ended REAL, slots INTEGER);
CREATE TABLE IF NOT EXISTS recordings (
  name TEXT PRIMARY KEY, source TEXT, state TEXT, reason TEXT, trace TEXT, scans INTEGER, points INTEGER,
  moving INTEGER, fingerprint TEXT, warnings TEXT, fresh INTEGER, seconds REAL, cpu_seconds REAL, peak_mb REAL,
  ended REAL);
CREATE TABLE IF NOT EXISTS units (
  recording TEXT, unit TEXT, state TEXT, tries INTEGER, place TEXT, reason TEXT, started REAL, ended REAL,
  seconds REAL, cpu_seconds REAL, peak_mb REAL, PRIMARY KEY (recording, unit));
"""


class Ledger:
    """The ledger of one process that distributes work; others read it with `read_status`."""

    def __init__(self, path: Path, published: str | None = None):
        """Open or create the ledger at `path`; `published` is the URL of a copy to be kept up to date."""
        claim(path.parent, LEDGER)
        self._path, self._published, self._saved = path, published, 0.0
        self._is_broken = False
        try:
            self._books = sqlite3.connect(path, isolation_level=None, timeout=30.0)
            self._books.executescript(_TABLES)
        except sqlite3.Error as error:
            raise InputError(f"{path} cannot be written ({error}): choose another --out") from None

    def begin(
        self, recordings: Iterable[Recording], settings_key: str, settings: str, versions: dict[str, str], slots: int
    ) -> None:
        """Record the work to do; the records of an earlier call are kept."""
        now = time.time()
        with self._writing():
            self._books.execute("BEGIN")
            self._books.execute("DELETE FROM run")
            self._books.execute(
                "INSERT INTO run VALUES (?, ?, ?, ?, ?, NULL, ?)",
                (settings_key, settings, json.dumps(versions), now, now, slots),
            )
            rows = [(recording.name, shown(recording.source)) for recording in recordings]
            not_done = self._books.execute("SELECT name FROM recordings WHERE state != 'done'").fetchall()
            gone = set(not_done) - {row[:1] for row in rows}
            self._books.executemany("DELETE FROM recordings WHERE name = ?", gone)
            self._books.execute("DELETE FROM units WHERE state != 'done'")
            self._books.execute("UPDATE recordings SET state = 'waiting', reason = NULL WHERE state != 'done'")
            self._books.executemany(
                "INSERT INTO recordings (name, source, state) VALUES (?, ?, 'waiting') ON CONFLICT DO NOTHING", rows
            )
            self._books.execute("COMMIT")
        self.save()

    def started(self, order: Order, tries: int) -> None:
        """Record that a unit was given to a worker."""
        with self._writing():
            self._books.execute(
                "INSERT OR REPLACE INTO units (recording, unit, state, tries, started) VALUES (?, ?, 'running', ?, ?)",
                (order.recording.name, str(order.unit), tries, time.time()),
            )
            self._set(order.recording.name, state="running")

    def ended(self, order: Order, report: Report) -> None:
        """Record the outcome of a unit."""
        costs = (report.seconds, report.cpu_seconds, report.peak_mb)
        values = (report.state.value, report.place, report.reason, time.time(), *costs)
        with self._writing():
            self._books.execute(
                "UPDATE units SET state = ?, place = ?, reason = ?, ended = ?, seconds = ?, cpu_seconds = ?, "
                "peak_mb = ? WHERE recording = ? AND unit = ?",
                (*values, order.recording.name, str(order.unit)),
            )
            if report.scans:
                self._set(order.recording.name, scans=report.scans)

    def labelled(self, recording: Recording, report: Report) -> None:
        """Record that a recording is labelled."""
        found = {name: getattr(report, name) for name in ("scans", "points", "moving", "fingerprint")}
        found |= {"warnings": json.dumps(report.warnings), "fresh": int(report.is_fresh), "ended": time.time()}
        with self._writing():
            self._set(recording.name, state="done", reason=None, trace=None, **found)
            if report.is_fresh:
                self._books.execute(
                    "UPDATE recordings SET (seconds, cpu_seconds, peak_mb) = (SELECT SUM(seconds), SUM(cpu_seconds), "
                    "MAX(peak_mb) FROM units WHERE recording = name) WHERE name = ?",
                    (recording.name,),
                )

    def failed(self, recording: Recording, reason: str, trace: str) -> None:
        """Record why a recording is not labelled."""
        with self._writing():
            self._set(recording.name, state="failed", reason=reason, trace=trace, ended=time.time())

    def tick(self) -> None:
        """Record that the run is alive; from time to time, upload a copy of the ledger."""
        with self._writing():
            self._books.execute("UPDATE run SET seen = ?", (time.time(),))
        if time.monotonic() - self._saved > _SAVE_EVERY_S:
            self.save()

    def save(self) -> None:
        """Upload a copy of the ledger, if it is published."""
        self._saved = time.monotonic()
        if self._published is None:
            return
        base, _, name = self._published.rpartition("/")
        copy = self._path.with_suffix(".copy")
        try:
            with closing(sqlite3.connect(copy)) as books:
                self._books.backup(books)
            Store(base).put(str(copy), name)
        except (ValueError, OSError, RuntimeError, sqlite3.Error) as error:
            _log.warning("the ledger could not be copied to %s: %s", shown(self._published), error)
        finally:
            copy.unlink(missing_ok=True)

    def close(self) -> None:
        """Record that the run has ended."""
        with self._writing():
            self._books.execute("UPDATE run SET ended = ?", (time.time(),))
            self._books.execute("UPDATE recordings SET state = 'waiting' WHERE state = 'running'")
            self._books.execute("UPDATE units SET state = 'waiting' WHERE state = 'running'")
        self.save()
        self._books.close()

    def _set(self, name: str, **values: object) -> None:
        columns = ", ".join(f"{column} = ?" for column in values)
        self._books.execute(f"UPDATE recordings SET {columns} WHERE name = ?", (*values.values(), name))

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            if self._books.in_transaction:
                self._books.execute("ROLLBACK")
            if not self._is_broken:
                _log.error("the ledger %s cannot be written (%s); the work goes on without", self._path, error)
            self._is_broken = True


def ledger_name(shard: tuple[int, int] | None) -> str:
    """Return the file name of the ledger of shard (i, n), or of a run that is not shared out."""
    return "run.sqlite" if shard is None else f"shard-{shard[0]}-of-{shard[1]}.sqlite"


def missing_shards(names: Iterable[str]) -> list[str]:
    """Return the shards, as i/n, whose ledger is missing although that of another shard of the same n exists."""
    there = {(int(found[1]), int(found[2])) for found in map(_SHARD.fullmatch, names) if found}
    return [f"{i}/{n}" for n in sorted({n for _, n in there}) for i in range(n) if (i, n) not in there]


def ledger_folder(target: str) -> str:
    """Return the path or URL of the folder that holds a run's ledgers."""
    return join(target, "ledger")
