"""What stands before or behind the points of files that are read as if they held nothing else."""

from collections.abc import Sequence

import numpy as np

from automos.core.scan import MAX_RANGE, MIN_RANGE
from automos.readers.layouts import parse_columns


@np.errstate(invalid="ignore")
def find_foreign(ends: Sequence[bytes], columns: str, is_behind: bool = False) -> int:
    """Return how many bytes at the beginning of some files of one kind, or at their end, are no points of `columns`.

    Whole numbers, words and clocks read as coordinates lie at the sensor or beyond its range, and what stands in all
    files alike is no point, which noise and motion would have changed; unless there is more of either among the points,
    as of sensors that mark what they miss.

    Parameters
    ----------
    ends : whole records, of each file the first ones, or the last.
    """
    point = parse_columns(columns)
    n = min(map(len, ends)) // point.itemsize
    records = [np.frombuffer(raw, point)[:: -1 if is_behind else 1][:n] for raw in ends]
    rows = np.stack(records)
    size = np.stack([np.abs(rows[axis]) for axis in "xyz"], axis=-1)
    longest, is_whole = size.max(axis=-1), (size > 0.0) & (size < np.finfo(point["x"]).tiny)
    is_none = np.isfinite(longest) & ((longest > MAX_RANGE) | (longest < MIN_RANGE) | is_whole.any(axis=-1))
    is_none &= longest > 0.0
    raw = rows.view(np.uint8).reshape(len(rows), n, point.itemsize)
    shared = (raw == (raw[0] if len(rows) > 2 else 0)).all(axis=0).mean(axis=-1)
    is_odd = (is_none.mean(axis=0) > 0.5) | ((shared == 1.0) & (longest[0] > 0.0) & np.isfinite(longest[0]))
    odd, is_empty = np.flatnonzero(is_odd), ~raw.any(axis=(0, 2))
    end = odd[-1] + 1 if len(odd) else 0
    known = (is_odd | is_empty)[:end]
    if end == 0 or not known[0] or 2 * known.sum() < end or 2 * end > n:
        return 0
    return int(end + np.argmin(shared[end:] > 0.5)) * point.itemsize  # what goes on much the same is of it, too
