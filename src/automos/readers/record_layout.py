"""What the records of files without a header hold, found from their content.

A record repeats: the bytes at one place of all of them are alike, and those at different places are not. The size of
a record is therefore the one under which the file is described by the fewest bits, each byte of the record by a code
of its own. What a multiple of it saves is little: the smallest size that explains nearly as much is taken. Only sizes
that divide the files count, and only those under which coordinates are numbers that coordinates can be.
"""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.scan import MAX_RANGE, MIN_RANGE, Ints
from automos.readers.codecs import LAYOUTS, parse_columns
from automos.readers.columns import MAX_COLUMNS, UNNAMED
from automos.readers.record_columns import ENOUGH, Rows, columns_of, has_numbers, is_several


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


_SIZES = range(12, 129)
"""Bytes of a record: three coordinates, to the largest struct of a driver."""
_AS_GOOD = 0.97
"""Share of what the best size explains from which another explains as much."""
_ROWS, _FILES, _READ = 12_000, 4, 1 << 21
"""Records that are looked at, of so many files, and bytes that are read of each."""


@np.errstate(all="ignore")
def find_columns(paths: Sequence[Path]) -> str:
    """Return the columns of the files at `paths`, all of one kind, as `--columns` takes them.

    Raises
    ------
    InputError
        Several fit, or none.
    """
    sizes = np.array([path.stat().st_size for path in paths])
    largest = [path for path, size in zip(paths, sizes, strict=True) if size > 0.5 * sizes.max()]
    looked_at = evenly_spread(largest, _FILES)
    pool = [np.fromfile(path, np.uint8, _READ) for path in looked_at]
    divided = [size for size in _SIZES if 2 * np.count_nonzero(sizes % size == 0) > len(sizes)]
    fitting = [size for size in divided if has_numbers(_rows(pool, size))]
    some = _rows(pool, _SIZES[0])
    if len(some) < ENOUGH or (some == some[0, 0]).all():
        return _by_convention(fitting, sizes, paths)
    gain = {size: _gain(_rows(pool, size)) for size in fitting}
    best = max(fitting, key=gain.__getitem__, default=0)
    if not fitting or gain[best] <= 0.0:
        raise InputError(_unknown(paths, sizes, []))
    likely = [size for size in fitting if gain[size] >= _AS_GOOD * gain[best]]
    least = next(size for size in likely if best % size == 0)
    smaller = [size for size in range(_SIZES[0], best, 4) if best % size and size % least]
    if any(_gain(_rows(pool, size)) > gain[best] for size in smaller):  # behind a header, or cut
        raise InputError(_unknown(paths, sizes, []))
    size = next(s for s in fitting if best % s == 0 and (s in likely or is_several(_rows(pool, best), s)))
    rivals = [size, *(other for other in likely if other % size and size % other)]
    found = [columns for rival in rivals if (columns := columns_of(_rows(pool, rival))) is not None]
    if LAYOUTS["bin"] in found:
        found = [LAYOUTS["bin"]]
    if len(found) != 1:
        raise InputError(_unknown(paths, sizes, found))
    require_points(looked_at, found[0], _ROWS)
    return _required(found[0], sizes, paths)


@np.errstate(all="ignore")
def names_of(matrix: npt.NDArray, path: Path, columns: str = "") -> Sequence[str]:
    """Return what the columns of an (N, C) array without names are: as `columns` says, else what they show, or usual.

    Raises
    ------
    InputError
        Others come before x, y and z, as it seems.
    """
    if columns:
        return parse_columns(columns).names or UNNAMED
    n = matrix.shape[1] if matrix.ndim == 2 else 0
    if not 3 < n <= MAX_COLUMNS or len(matrix) <= ENOUGH:
        return UNNAMED
    rows = np.ascontiguousarray(matrix[:: max(len(matrix) // _ROWS, 1)], "<f8").view(np.uint8)
    found = parse_columns(columns_of(rows, ("<f8",)) or LAYOUTS["bin"])
    names = ["_" if name.startswith("_") else name for name in found.names or ()]
    if len(names) != n or found.itemsize != 8 * n:
        return UNNAMED
    if names[:3] != ["x", "y", "z"]:
        said = ",".join(names)
        raise InputError(f"{path} does not name its columns, which seem to be {said}; name them with --columns {said}")
    usual = UNNAMED if n == len(UNNAMED) else UNNAMED[:4]
    left = [name if name not in names else "_" for name in usual] + ["_"] * n
    named = [own if own != "_" else other for own, other in zip(names, left, strict=False)]
    return [f"_{k}" if name == "_" else name for k, name in enumerate(named)]


def _by_convention(fitting: list[int], sizes: Ints, paths: Sequence[Path]) -> str:
    """Return KITTI's columns where they fit, or nothing does; few records do not show others."""
    if 2 * np.count_nonzero(sizes % 16 == 0) <= len(sizes) or (fitting and 16 not in fitting):
        raise InputError(_unknown(paths, sizes, []))
    return _required(LAYOUTS["bin"], sizes, paths)


def _required(columns: str, sizes: Ints, paths: Sequence[Path]) -> str:
    """Return `columns`; InputError where a file is no whole number of them."""
    size = parse_columns(columns).itemsize
    if (sizes % size).any():
        odd = int(np.argmax(sizes % size != 0))
        raise InputError(
            f"{paths[odd]} has {sizes[odd]} bytes, no multiple of a point as in the other files ({columns}: {size} "
            "bytes); it is cut short, or of another kind: copy it again, or name the columns with --columns"
        )
    return columns


def _unknown(paths: Sequence[Path], sizes: Ints, candidates: Collection[str]) -> str:
    odd = int(np.argmax(sizes % 16 != 0))
    fits = "; fitting are " + " and ".join(f"--columns {one}" for one in candidates) if candidates else ""
    return (
        f"{paths[odd]} has {sizes[odd]} bytes and no header that is known, and its content does not show which columns "
        f"its points have{fits}: say which, as in --columns x,y,z,intensity or --columns x:f8,y,z, or copy the file "
        "again"
    )


def _rows(pool: list[npt.NDArray[np.uint8]], size: int) -> Rows:
    """Return (N, size) some of the records, in runs: every so many would be every second of a smaller size."""
    parts: list[Rows] = []
    for raw in pool:
        records = raw[: len(raw) // size * size].reshape(-1, size)
        most = max(_ROWS // len(pool), 1)
        starts = np.linspace(0, max(len(records) - most // 4, 0), 4).astype(int)
        parts += [records] if len(records) <= most else [records[at : at + most // 4] for at in starts]
    return np.concatenate(parts) if parts else np.zeros((0, size), np.uint8)


def _gain(rows: Rows) -> float:
    """Return how many bits a byte of `rows` takes less in a code for each place of a record than in one for all."""
    size = rows.shape[1]
    counts = np.bincount((rows + 256 * np.arange(size)).ravel(), minlength=256 * size).reshape(size, 256)
    return _code_length(counts.sum(axis=0, keepdims=True)) - _code_length(counts)


def _code_length(counts: Ints) -> float:
    """Return the bits that a byte takes in one code for each row of `counts` (P, 256), with what it takes to tell them.

    Every code is of as many bytes.
    """
    n = counts[0].sum()
    share = counts / n
    entropy = -np.sum(share * np.log2(share, where=share > 0, out=np.zeros_like(share)))
    return float((entropy + 0.5 * np.log2(n) / n * np.sum((counts > 0).sum(axis=1) - 1)) / len(counts))
