"""Headers before the points of files that are read as if they had none: rows that no points can be."""

from collections.abc import Sequence

import numpy as np

from automos.core.scan import MAX_RANGE, MIN_RANGE
from automos.readers.layouts import parse_columns


@np.errstate(invalid="ignore")
def find_header(beginnings: Sequence[bytes], columns: str) -> int:
    """Return how many bytes at the beginning of some files of one kind are no points of `columns`.

    Whole numbers, words and clocks read as coordinates lie at the sensor or beyond its range, and what stands in all
    files alike is no point, which noise and motion would have changed; unless there is more of either among the points,
    as of sensors that mark what they miss.
    """
    point = parse_columns(columns)
    n = min(map(len, beginnings)) // point.itemsize
    rows = np.stack([np.frombuffer(raw, point, n) for raw in beginnings])
    size = np.stack([np.abs(rows[axis]) for axis in "xyz"], axis=-1)
    longest, is_whole = size.max(axis=-1), (size > 0.0) & (size < np.finfo(point["x"]).tiny)
    is_none = np.isfinite(longest) & ((longest > MAX_RANGE) | (longest < MIN_RANGE) | is_whole.any(axis=-1))
    is_none &= longest > 0.0
    raw = rows.view(np.uint8).reshape(len(rows), n, point.itemsize)
    shared = (raw == (raw[0] if len(rows) > 2 else 0)).all(axis=0).mean(axis=-1)
    is_odd = (is_none.mean(axis=0) > 0.5) | ((shared == 1.0) & (longest[0] > 0.0) & np.isfinite(longest[0]))
    odd = np.flatnonzero(is_odd)
    end = odd[-1] + 1 if len(odd) else 0
    if not len(odd) or odd[0] > 0 or 2 * len(odd) < end or 2 * end > n:
        return 0
    return int(end + np.argmin(shared[end:] > 0.5)) * point.itemsize  # what goes on much the same is of it, too
