"""Point files with some of their points left out, in the kind that they are of and with every column that they have."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_npy, write_raw
from automos.core.errors import InputError
from automos.core.reading import read_array
from automos.readers.bin import WIDTHS
from automos.readers.codecs import read_columns, suffix_codec
from automos.readers.formats import import_extra
from automos.writers.pcd import write_pcd

Mask = npt.NDArray[np.bool_]
Rewrite = Callable[[Path, Path, str, Mask], None]
"""Takes the file, the one to write, its codec, and (N,) which points are kept."""


def _rewrite_bin(source: Path, target: Path, codec: str, kept: Mask) -> None:
    write_raw(target, np.fromfile(source, np.float32).reshape(-1, WIDTHS[codec])[kept])


def _rewrite_npy(source: Path, target: Path, codec: str, kept: Mask) -> None:
    write_npy(target, read_array(source)[kept])


def _rewrite_pcd(source: Path, target: Path, codec: str, kept: Mask) -> None:
    write_pcd(target, {name: column[kept] for name, column in read_columns(source, codec).items()})


def _rewrite_las(source: Path, target: Path, codec: str, kept: Mask) -> None:
    laspy = import_extra("laspy", "las")
    las = laspy.read(source)
    las.points = las.points[kept]
    packed = io.BytesIO()  # what packs does not tell a full disk from other faults
    las.write(packed, do_compress=source.suffix.lower() == ".laz")
    with atomic_path(target) as temporary:
        temporary.write_bytes(packed.getvalue())


REWRITES: dict[str, Rewrite] = {
    "bin": _rewrite_bin,
    "npy": _rewrite_npy,
    "pcd": _rewrite_pcd,
    "las": _rewrite_las,
}
"""How the files of each kind are written again."""


def rewrite_of(codec: str) -> Rewrite:
    """Return how files of `codec` are written again; InputError where only others can be written of them."""
    kind = suffix_codec(codec)
    if kind not in REWRITES:
        raise InputError(f"scans in {codec} files are not written again as such: give --as bin, pcd or laz")
    return REWRITES[kind]
