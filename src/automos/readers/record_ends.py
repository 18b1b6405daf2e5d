"""What stands before or behind the points of files that are read as if they held nothing else."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import MAX_RANGE, MIN_RANGE
from automos.readers.layouts import parse_columns


def require_points(paths: Sequence[Path], columns: str, most: int) -> None:
    """Raise where the files at `paths` hold more than points of `columns`; `most` are looked at, at each end."""
    point = parse_columns(columns)
    sizes = [path.stat().st_size // point.itemsize for path in paths]
    n = min(*sizes, most)
    first = np.stack([np.fromfile(path, point, n) for path in paths])
    last = [np.fromfile(path, point, n, offset=(k - n) * point.itemsize) for path, k in zip(paths, sizes, strict=True)]
    for where, rows, cut in (("begins", first, "tail -c +{}"), ("ends", np.stack(last)[:, ::-1], "head -c -{}")):
        if n_bytes := find_foreign(rows):
            raise InputError(
                f"{paths[0]} {where} with {n_bytes} bytes that are no points ({columns}), as the other files do: cut "
                f"them off each ({cut.format(n_bytes + (where == 'begins'))}) and give what is left, or say with "
                "--columns that they are"
            )


@np.errstate(invalid="ignore")
def find_foreign(rows: npt.NDArray) -> int:
    """Return how many bytes at the beginning of some files of one kind, of (F, N) `rows`, are no points.

    Whole numbers, words and clocks read as coordinates lie at the sensor or beyond its range, and what stands in all
    files alike is no point, which noise and motion would have changed; unless there is more of either among the points,
    as of sensors that mark what they miss.
    """
    point, n = rows.dtype, rows.shape[1]
    size = np.stack([np.abs(rows[axis]) for axis in "xyz"], axis=-1)
    longest, is_whole = size.max(axis=-1), (size > 0.0) & (size < np.finfo(point["x"]).tiny)
    is_none = np.isfinite(longest) & ((longest > MAX_RANGE) | (longest < MIN_RANGE) | is_whole.any(axis=-1))
    is_none &= longest > 0.0
    raw = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), n, point.itemsize)
    shared = (raw == (raw[0] if len(rows) > 2 else 0)).all(axis=0).mean(axis=-1)
    is_odd = (is_none.mean(axis=0) > 0.5) | ((shared == 1.0) & (longest[0] > 0.0) & np.isfinite(longest[0]))
    odd, is_empty = np.flatnonzero(is_odd), ~raw.any(axis=(0, 2))
    end = odd[-1] + 1 if len(odd) else 0
    known = (is_odd | is_empty)[:end]
    if end == 0 or not known[0] or 2 * known.sum() < end or 2 * end > n:
        return 0
    return int(end + np.argmin(shared[end:] > 0.5)) * point.itemsize  # what goes on much the same is of it, too
