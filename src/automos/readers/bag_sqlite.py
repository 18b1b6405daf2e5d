"""SQLite files of ROS 2's recorder (.db3), read by Python's own library."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from automos.readers.bag_file import LARGEST, BagFile, Topic, type_name

T = TypeVar("T")


class SqliteFile(BagFile):
    """A .db3."""

    def __init__(self, path: Path):
        """List the topics; errors are those of `BagFile`."""
        super().__init__(path)
        for number, name, kind, encoding in self._rows("SELECT id, name, type, serialization_format FROM topics"):
            self.topics[number] = Topic(name, type_name(kind), encoding)

    def places(self, number: int) -> npt.NDArray[np.int64]:
        """Return (N, 3) when each message of topic `number` was recorded (ns), 0, and its number in the file."""
        rows = self._rows("SELECT timestamp, 0, id FROM messages WHERE topic_id = ? ORDER BY timestamp, id", number)
        return np.array(rows, np.int64).reshape(-1, 3)

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message of a number."""
        rows = self._rows("SELECT substr(data, 1, ?) FROM messages WHERE id = ?", most, place)
        if not rows:
            raise EOFError(f"it has no message {place} any more")
        return bytes(rows[0][0])

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message of a number has."""
        return int(self._rows("SELECT length(data) FROM messages WHERE id = ?", place)[0][0])

    def _rows(self, query: str, *values: int) -> list[tuple]:
        return self._using(lambda connection: connection.execute(query, values).fetchall())

    def copy_to(self, target: sqlite3.Connection) -> None:
        """Copy the whole database, with what is in its journal alone."""
        self._using(lambda connection: connection.backup(target))

    def _using(self, use: Callable[[sqlite3.Connection], T]) -> T:
        where = self.path.absolute().as_uri()
        try:  # read only, with the journal that a killed recorder left beside it
            return _used(f"{where}?mode=ro", use)
        except sqlite3.OperationalError:  # on a disk that is read only, too
            return _used(f"{where}?immutable=1", use)


def _used(uri: str, use: Callable[[sqlite3.Connection], T]) -> T:
    with closing(sqlite3.connect(uri, uri=True)) as connection:
        connection.execute("PRAGMA trusted_schema = OFF")
        return use(connection)
