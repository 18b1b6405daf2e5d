"""Parquet tables: whole columns of small ones, and single rows of those whose columns are images."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.extras import import_extra
from automos.core.reading import damage_reported, require_regular
from automos.readers.foreign import limited

_BATCH = 5
"""Rows decoded at once."""
_WHOLE = "the recording needs it: download it too"


def read_columns(path: Path, columns: Sequence[str]) -> dict[str, np.ndarray]:
    """Return whole columns of a table; of lists, as arrays of arrays.

    Raises
    ------
    InputError
        The table is absent, damaged, or has no such column.
    """
    with arrow_reported(path):
        table = import_extra("pyarrow.parquet", "arrow").read_table(path, columns=list(columns))
        return {name: table[name].to_numpy() for name in columns}


class RowReader:
    """Rows of an opened table, one at a time, fastest forwards: what lies before a row in its group is decoded too."""

    def __init__(self, path: Path, columns: Sequence[str]):
        """Open the table at `path` to read `columns` of it; errors are those of `read_columns`."""
        self._path, self._columns = path, list(columns)
        with arrow_reported(path):
            self._file = import_extra("pyarrow.parquet", "arrow").ParquetFile(path)
            groups = [self._file.metadata.row_group(k).num_rows for k in range(self._file.num_row_groups)]
        self._starts = np.concatenate([[0], np.cumsum(groups)])
        self._batches: Iterator[Any] = iter(())
        self._batch: Any = None
        self._first = self._end = 0

    def __getitem__(self, row: int) -> dict[str, np.ndarray]:
        with arrow_reported(self._path):
            group = int(np.searchsorted(self._starts, row, side="right")) - 1
            if row < self._first or self._starts[group] > self._end or self._batch is None:
                groups = list(range(group, len(self._starts) - 1))
                self._batches = self._file.iter_batches(_BATCH, row_groups=groups, columns=self._columns)
                self._first = self._end = int(self._starts[group])
            while row >= self._end:
                self._batch = next(self._batches)
                self._first, self._end = self._end, self._end + self._batch.num_rows
            return {
                name: self._batch.column(name)[row - self._first].values.to_numpy(zero_copy_only=False)
                for name in self._columns
            }


@contextmanager
def arrow_reported(path: Path, if_missing: str = _WHOLE, or_else: str = "of another layout") -> Iterator[None]:
    """Turn what pyarrow stumbles over, within its time, into one sentence; `or_else` is what a damaged file may be."""
    import_extra("pyarrow", "arrow")
    what = f"is damaged or {or_else}"
    with damage_reported(path, what, "download it again", if_missing, Exception), limited(path):
        require_regular(path)
        yield
