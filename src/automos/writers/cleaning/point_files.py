"""Point files with some of their points left out, in the kind that they are of and with every column that they have."""

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_bytes, write_npy, write_raw
from automos.core.errors import InputError
from automos.core.reading import read_array, read_bytes
from automos.readers.codecs import parse_columns
from automos.readers.folder import FolderSequence
from automos.readers.formats import import_extra
from automos.readers.npy import as_rows
from automos.readers.pcd import read, read_header
from automos.writers.point_columns import write_pcd

Mask = npt.NDArray[np.bool_]
Rewrite = Callable[[Path, Path, str, Mask], None]
"""Takes the file, the one to write, the columns of files that do not name them, and (N,) which points are kept."""


def _rewrite_bin(source: Path, target: Path, columns: str, kept: Mask) -> None:
    write_raw(target, np.frombuffer(read_bytes(source), parse_columns(columns))[kept])


def _rewrite_npy(source: Path, target: Path, columns: str, kept: Mask) -> None:
    array = read_array(source)
    write_npy(target, (array.reshape(-1) if array.dtype.names else as_rows(array))[kept])


def _rewrite_pcd(source: Path, target: Path, columns: str, kept: Mask) -> None:
    """Write binary points byte for byte under their own header, others as binary ones; organised clouds as one row."""
    header, raw = read_header(source), read_bytes(source)
    if header.encoding == "binary":
        head, n = raw[: header.start], int(kept.sum())
        for entry, number in ((b"WIDTH", n), (b"HEIGHT", 1), (b"POINTS", n)):
            head = re.sub(rb"(?im)^([^\S\n]*%b[^\S\n]+)\S+" % entry, rb"\g<1>%d" % number, head)
        rows = np.frombuffer(raw, header.dtype, header.n_points, header.start)[kept]
        write_bytes(target, head + rows.tobytes())
        return
    several = [name for name in header.dtype.names or () if header.dtype[name].shape and not name.startswith("_")]
    if several:
        raise InputError(
            f"{source} has several values a point as {several[0]} in {header.encoding}, which is not written again as "
            "such: give --as bin, pcd or laz, or write it again as binary"
        )
    is_moved = not np.array_equal(header.viewpoint, np.eye(4))
    cut = {name: column[kept] for name, column in read(source).items()}
    write_pcd(target, cut, header.viewpoint if is_moved else None)


def _rewrite_las(source: Path, target: Path, columns: str, kept: Mask) -> None:
    laspy = import_extra("laspy", "las")
    las = laspy.read(source)
    las.points = las.points[kept]
    packed = io.BytesIO()  # what packs does not tell a full disk from other faults
    las.write(packed, do_compress=source.suffix.lower() == ".laz")
    write_bytes(target, packed.getvalue())


REWRITES: dict[str, Rewrite] = {
    "bin": _rewrite_bin,
    "npy": _rewrite_npy,
    "pcd": _rewrite_pcd,
    "las": _rewrite_las,
}
"""How the files of each kind are written again."""


def rewrite_of(sequence: FolderSequence) -> Rewrite:
    """Return how the files of `sequence` are written again; InputError where only others can be written of them."""
    suffixes = {path.suffix.lower() for path in sequence.paths}
    if sequence.codec not in REWRITES or ".npz" in suffixes:
        raise InputError(f"scans in {min(suffixes)} files are not written again as such: give --as bin, pcd or laz")
    return REWRITES[sequence.codec]
