"""Damage to tables and arrays (values, types, shapes, columns, rows), and to bytes where these cannot be read."""

import random
import struct
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.reading import DAMAGE

WHOLE = (0, 1, -1, 2, 255, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)


def write_noise(path: Path, rng: random.Random) -> str:
    """Write a number or noise somewhere, more often near the beginning."""
    content = bytearray(path.read_bytes())
    at = rng.randrange(max(min(len(content), rng.choice((64, 400, len(content)))), 1))
    form = rng.choice(["<B", "<H", "<I", "<Q", "<f", "<d", ">I", ">H"])
    value = rng.choice((float("nan"), float("inf"), 6e18, 1e38, -1e6)) if form[1] in "fd" else rng.choice(WHOLE)
    packed = struct.pack(form, value if form[1] in "fd" else value % (1 << 8 * struct.calcsize(form)))
    content[at : at + len(packed)] = packed
    path.write_bytes(content)
    return f"{form} {value} at {at}"


def change_array(path: Path, rng: random.Random) -> str:
    """Change the values, the shape or the type of an array."""
    try:
        array = np.load(path)
    except (OSError, *DAMAGE):  # damaged before
        return write_noise(path, rng)
    changed, what = _changed(array, rng)
    with path.open("wb") as file:
        np.save(file, changed)
    return what


def _changed(array: np.ndarray, rng: random.Random) -> tuple[np.ndarray, str]:
    """Return `array` with something hostile done to it, and what it was."""
    what = rng.choice(("cut", "twice", "flat", "scalar", "value", "value", "value", "all", "type", "words"))
    if what == "cut":
        return array[: len(array) // 2] if array.ndim else array, what
    if what == "twice":
        return np.concatenate([array, array]) if array.ndim else np.stack([array] * 2), what
    if what in ("flat", "scalar"):
        return (array.ravel() if what == "flat" else array.ravel()[:1].reshape(()) if array.size else array), what
    if what == "type":
        kind = rng.choice(("f2", "f8", "i1", "u8", "c16", "?"))
        with np.errstate(all="ignore"):
            return (array.astype(kind) if array.dtype.kind in "fiub" else array), f"as {kind}"
    if what == "words":
        return np.full(array.shape, "x"), what
    if not array.size or array.dtype.kind not in "fiub":
        return array, "nothing"
    value = rng.choice((np.nan, np.inf, 1e30, -1.0, 0.0) if array.dtype.kind == "f" else (*WHOLE, -5))
    out = array.copy()
    with np.errstate(all="ignore"):
        hostile = np.array(value).astype(array.dtype) if array.dtype.kind == "f" else _wrapped(value, array.dtype)
        if what == "all":
            out[...] = hostile
        else:
            out.ravel()[rng.randrange(array.size)] = hostile  # a copy is contiguous
    return out, f"{what} {value}"


def _wrapped(value: int, dtype: np.dtype) -> np.ndarray:
    return np.array(value % (1 << 64), np.uint64).astype(dtype)


def change_column(path: Path, rng: random.Random) -> str:
    """Change one column of a table of Parquet's or Feather's: values, type, nulls; or take it out, or all its rows."""
    import pyarrow
    from pyarrow import feather, parquet

    is_feather = path.suffix == ".feather"
    try:
        table = feather.read_table(path) if is_feather else parquet.read_table(path)
    except (pyarrow.ArrowException, OSError):
        return write_noise(path, rng)
    name = rng.choice(table.column_names)
    k, column = table.column_names.index(name), table[name]
    what = rng.choice(("gone", "nulls", "a null", "empty", "twice", "words", "value", "value", "value", "lists"))
    if what == "gone":
        table = table.drop_columns([name])
    elif what in ("empty", "twice"):
        table = table.slice(0, 0) if what == "empty" else pyarrow.concat_tables([table, table])
    else:
        values = column.to_pylist()
        at = rng.randrange(len(values)) if values else 0
        if what in ("nulls", "words", "lists"):
            values = [{"nulls": None, "words": "x", "lists": [1.0]}[what]] * len(values)
        elif values:
            values[at] = None if what == "a null" else _other(values[at], rng)
        try:
            made = pyarrow.array(values, None if what in ("words", "lists") else column.type)
        except (pyarrow.ArrowException, OverflowError, TypeError, ValueError):
            made = pyarrow.nulls(len(values), column.type)
        table = table.set_column(k, name, made)
    feather.write_feather(table, path) if is_feather else parquet.write_table(table, path)
    return f"{name}: {what}"


def _other(value: Any, rng: random.Random) -> Any:
    if isinstance(value, list) and value:
        k = rng.randrange(len(value))
        return rng.choice(([], value[:-1], value * 2, [*value[:k], _other(value[k], rng), *value[k + 1 :]]))
    if isinstance(value, float):
        return rng.choice((float("nan"), float("inf"), 1e30, 0.0, -1.0))
    return rng.choice((0, 1, -1, 127, 2**31 - 1, 2**62)) if isinstance(value, int) else "x"


def change_rows(path: Path, rng: random.Random) -> str:
    """Change a value of a table of SQLite's, or take a table, a column or rows away."""
    import sqlite3

    base = sqlite3.connect(path)
    try:
        tables = [row[0] for row in base.execute("SELECT name FROM sqlite_master WHERE type='table'")]
        table = rng.choice(sorted(tables))
        columns = [row[1] for row in base.execute(f"PRAGMA table_info('{table}')")]
        column, value = rng.choice(columns), rng.choice((0, -1, 2**62, 1.5, "x", b"", b"\xff" * 64, None))
        (rowid,) = base.execute(f"SELECT rowid FROM '{table}' ORDER BY random() LIMIT 1").fetchone() or (0,)
        how = rng.choice(
            [
                (f"UPDATE '{table}' SET '{column}' = ? WHERE rowid = {rowid}", (value,)),
                (f"UPDATE '{table}' SET '{column}' = ?", (value,)),
                (f"DELETE FROM '{table}'", ()),
                (f"DROP TABLE '{table}'", ()),
                (f"ALTER TABLE '{table}' RENAME COLUMN '{column}' TO 'renamed'", ()),
            ]
        )
        base.execute(*how)
        base.commit()
        return f"{how}"[:200]
    except (sqlite3.Error, UnicodeDecodeError, IndexError):  # of a damaged table, its name too
        return write_noise(path, rng)
    finally:
        base.close()
