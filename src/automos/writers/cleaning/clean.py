"""The recording of a run again, without its moving points: in its own kind, or as another.

In its own kind nothing but the points changes: files of the same names with the same columns, bags with the same
messages. What lies beside the scans of a folder (times, poses, calibration) is copied; true labels are not.
"""

import re
from collections import Counter
from collections.abc import Callable
from enum import Enum
from functools import partial
from pathlib import Path

import numpy as np

from automos.core.atomic import write_bytes, write_npy, write_raw, write_text
from automos.core.claims import CLEANED
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.labels import Label
from automos.core.own_folder import own_folder
from automos.core.reading import read_array, read_bytes
from automos.core.scan import Mask, Scan, Sequence
from automos.core.workspace import Workspace
from automos.readers.bag_messages import with_rows
from automos.readers.codecs import parse_columns
from automos.readers.folder import FolderSequence
from automos.readers.npy import as_rows
from automos.readers.pcd import read, read_header
from automos.readers.rosbag_topic import RosbagSequence
from automos.results.claiming import refuse_folder_of
from automos.results.run_files import RunFiles
from automos.writers import load_export
from automos.writers.cleaning.bags import require_rewritable, rewrite_bag
from automos.writers.formats import Export, copy_file, make_folders, point_columns, write_pcd
from automos.writers.las import las_bytes

Rows = Callable[[Scan, int], Mask]
"""Returns which points of a scan of some number are kept."""
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
    las = import_extra("laspy", "las").read(source)
    las.points = las.points[kept]
    write_bytes(target, las_bytes(las, source.suffix.lower() == ".laz"))


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


class Choice(Enum):
    """Which points are kept. Those without a return are kept with what does not move, as they tell nothing.

    Attributes
    ----------
    STATIC : what is labelled static.
    NOT_MOVING : also what has no label: the vehicle that carries the sensor, and places never observed.
    MOVING : what moves, and nothing else.
    """

    STATIC = "static points"
    NOT_MOVING = "all but moving points"
    MOVING = "moving points"

    def rows(self, run: RunFiles, scan: Scan, index: int) -> Mask:
        """Return (N,) which points of `scan`, number `index` of `run`, are kept."""
        labels = run.labels(index, len(scan))
        if self is Choice.MOVING:
            return labels == Label.MOVING
        return (labels != Label.MOVING) & ((labels == Label.STATIC) | ~scan.is_valid | (self is Choice.NOT_MOVING))


def _write_bin(run: RunFiles, out: Path) -> None:
    """Write every scan as `out / velodyne / <name>.bin`, in its own unit of intensity, and times.txt in seconds."""
    make_folders(out, "velodyne")
    for index in run.each("writing .bin"):
        columns = point_columns(run, index)
        nothing = np.zeros(len(columns["x"]), np.float32)
        rows = np.column_stack([columns.get(name, nothing) for name in ("x", "y", "z", "intensity")])
        write_raw(out / "velodyne" / f"{run.names[index]}.bin", rows.astype(np.float32))
    write_text(out / "times.txt", "".join(f"{stamp:.9f}\n" for stamp in run.stamps))


KINDS = {
    "bin": Export("velodyne/*.bin: x y z intensity, without labels; times.txt", _write_bin, is_of_points=True),
    **{name: load_export(name) for name in ("pcd", "laz", "mcap")},
}
"""Writers of points as the recording has them."""
MARKER = "clean.json"
_BESIDE = ("times.txt", "poses.txt", "calib.txt", "mounts.yaml")


def clean(run: RunFiles, out: Path, kind: str | None = None, choice: Choice = Choice.STATIC) -> tuple[Path, int, int]:
    """Write the recording of `run` with the points of `choice` to folder `out`; an interrupted call goes on.

    Parameters
    ----------
    kind : one of `KINDS`; the recording's own if not given, which "bag" says of a bag as well.

    Returns
    -------
    Path, int, int
        What was written; how many points were there, and how many were left out.

    Raises
    ------
    InputError
        The recording is of a kind that is not written, `out` holds other things, or the disk is full.
    """
    sequence = run.sequence
    is_own = kind is None or (isinstance(sequence, RosbagSequence) and kind in ("bag", sequence.source.suffix[1:]))
    write = _own_of(sequence) if is_own else partial(_as_other, _export_of(str(kind)))
    refuse_folder_of(sequence, out)
    about = {
        "format": "automos clean",
        "run": str(run.folder.absolute()),
        "labels": Workspace(run.folder).read_run().get("fingerprint"),
        "kind": "own" if is_own else kind,
        "kept": choice.value,
    }
    counts = Counter(points=0, left_out=0)

    def rows(scan: Scan, index: int) -> Mask:
        kept = choice.rows(run, scan, index)
        counts.update(points=len(kept), left_out=int((~kept).sum()))
        return kept

    with own_folder(out, CLEANED, MARKER, about) as found:
        written = write(run, rows, out)
        found.update(counts)
    return written, counts["points"], counts["left_out"]


def _export_of(kind: str) -> Export:
    if kind not in KINDS:
        raise InputError(f"--as {kind}: there is no such; there are {', '.join(KINDS)}, and bag of a bag")
    KINDS[kind].require()
    return KINDS[kind]


def _own_of(sequence: Sequence) -> Callable[[RunFiles, Rows, Path], Path]:
    """Return what writes a recording in its own kind; InputError where only others can be written of it."""
    if isinstance(sequence, RosbagSequence):
        require_rewritable(sequence)
        return partial(_rewrite_bag, sequence)
    if isinstance(sequence, FolderSequence):
        return partial(_rewrite_folder, sequence, rewrite_of(sequence))
    raise InputError(f"{sequence.name} is of a kind that is not written again as such: give --as bin, pcd or laz")


def _as_other(export: Export, run: RunFiles, rows: Rows, out: Path) -> Path:
    run.rows_of = rows
    written = out / f"{run.sequence.name}{export.suffix}" if export.suffix else out
    export.write(run, written)
    return written


def _rewrite_bag(sequence: RosbagSequence, run: RunFiles, rows: Rows, out: Path) -> Path:
    topic = sequence.topic

    def cut(index: int, raw: bytes) -> bytes:
        return with_rows(raw, topic.kind, topic.encoding == "cdr", rows(sequence[index], index))

    return rewrite_bag(sequence, out, cut)


def _rewrite_folder(sequence: FolderSequence, rewrite: Rewrite, run: RunFiles, rows: Rows, out: Path) -> Path:
    for name in _BESIDE:
        if (sequence.source / name).is_file():
            copy_file(sequence.source / name, out / name)
    for index in run.each("writing scans"):
        source = sequence.paths[index]
        target = out / source.relative_to(sequence.source)
        target.parent.mkdir(parents=True, exist_ok=True)
        rewrite(source, target, sequence.columns, rows(run.scan(index), index))
    return out
