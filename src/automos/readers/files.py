"""The scan files of a folder in time order, and the times that their names may hold."""

import hashlib
import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np

from automos.core.arrays import Array, Ints, Mask
from automos.core.errors import InputError
from automos.core.reading import damage_reported, require_regular
from automos.readers.codecs import CODEC_OF_SUFFIX, suffix_codec
from automos.readers.scan_times import NAMES, stamps_from_names

_SIDE_FILES = {*NAMES, "poses.txt", "calib.txt", "readme.txt", "requirements.txt"}
TEXT = {".txt", ".csv", ".tsv", ".zip"}  # which may be anything

_NUMBERS = re.compile(rb"(^|[\s,;|\"])([-+.\deE]+[\s,;|\"]+){2}[-+.\d]", re.M)
"""Three in a line, as points have them."""
_LONGEST_HEADER = 1 << 14
"""Bytes of a file that may be all header: longer ones hold points."""


def holds_point_files(folder: Path) -> bool:
    """Return whether any file of `folder` could be a scan."""
    return bool(point_files(folder))


def holds_scans(folder: Path) -> bool:
    """Return whether any file of `folder` is a scan by its name alone; text may be anything."""
    return any(_suffix(name) not in TEXT for name in point_files(folder))


def holds_tables(folder: Path) -> bool:
    """Return whether any text of `folder` holds numbers as points have them, and is no note; or an archive lies there.

    What cannot be read, or is empty, may be a table, which is told when it is opened.
    """
    for name in point_files(folder):
        with suppress(OSError, InputError):
            require_regular(folder / name)  # a pipe is waited for without end
            with open(folder / name, "rb") as file:
                start = file.read(_LONGEST_HEADER)
            is_one_line = len(start) == _LONGEST_HEADER and b"\n" not in start  # so many names of columns
            if not start.strip() or _suffix(name) == ".zip" or b"\0" in start or is_one_line or _NUMBERS.search(start):
                return True
    return False


def left_out_folders(source: Path, read: Path) -> list[str]:
    """Return what to say where other folders than the one that is `read` hold scans, too, in it or in its `source`."""
    warnings = []
    for folder in dict.fromkeys([source, read]):
        inner = [p for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".") and p != read]
        if names := ", ".join(sorted(p.name for p in inner if _holds_recording(p))[:5]):
            warnings.append(f"Folders in {folder} hold scans, too ({names}): they are left out, give their own paths.")
    return warnings


def _holds_recording(folder: Path) -> bool:
    with suppress(InputError, OSError):  # others' folders need not be readable
        places = (folder, folder / "velodyne", *folder.glob("*/velodyne"))
        return any(place.is_dir() and holds_scans(place) for place in places)
    return False


def list_scans(folder: Path, codec: str | None = None) -> tuple[list[str], str, Array | None]:
    """Return the names of `folder`'s scan files in time order, their codec, and the stamps (s) in their names, or None.

    `codec`, where given, picks the files of its suffix only. Order is that of the stamps, else natural (2 before 10).

    Raises
    ------
    InputError
        No scan files, or several kinds of them.
    """
    names = point_files(folder)
    if codec is not None and (wanted := suffix_codec(codec)) is not None:
        names = [name for name in names if CODEC_OF_SUFFIX[_suffix(name)] == wanted]
    elif any(_suffix(name) not in TEXT for name in names):
        # beside real point files these are notes and tables
        names = [name for name in names if _suffix(name) not in TEXT]
    if not names:
        wish = "" if codec is None else f" for format {codec!r}"
        raise InputError(f"{folder} holds no scans{wish}; give a folder of .bin, .pcd, .ply, .npy or .xyz files")
    _require_no_folder(folder, _suffix(names[0]))
    counts = Counter(map(_suffix, names)).most_common()
    kind = CODEC_OF_SUFFIX[counts[0][0]]
    if len(counts) > 1:
        listed = ", ".join(f"{count} {suffix}" for suffix, count in counts)
        raise InputError(f"{folder} mixes formats: {listed}; keep one kind, or name it with --format")
    _require_sound(names, folder)
    stamps = stamps_from_names([name[: -len(_suffix(name))] for name in names])
    _require_one_series(names, stamps, folder)
    if stamps is not None:
        order = np.argsort(stamps)
        return [names[i] for i in order], kind, stamps[order]
    return sorted(names, key=natural_key), kind, None


def find_copies(paths: Sequence[Path], n_points: Callable[[int], int]) -> Ints:
    """Return (N,) for each of `paths` the index of the first that holds the same, byte for byte; empty ones differ.

    `n_points` returns the number of points in one of them.
    """
    sizes = [path.stat().st_size for path in paths]
    of_size = Counter(sizes)
    glimpses = [
        _glimpse(path, size) if size > 0 and of_size[size] > 1 else None
        for path, size in zip(paths, sizes, strict=True)
    ]
    alike = Counter(glimpses)
    copy_of = np.arange(len(paths))
    first: dict[bytes, int] = {}
    for i, path in enumerate(paths):
        if glimpses[i] is not None and alike[glimpses[i]] > 1 and not _is_all_header(sizes[i], i, n_points):
            copy_of[i] = first.setdefault(hashlib.sha256(path.read_bytes()).digest(), i)
    return copy_of


def _is_all_header(size: int, index: int, n_points: Callable[[int], int]) -> bool:
    """Return whether a file, of `size` bytes, holds no points."""
    if size > _LONGEST_HEADER:
        return False
    with suppress(InputError):  # reported when the scan itself is read
        return n_points(index) == 0
    return False


def are_repeats(copy_of: Ints) -> Mask:
    """Return (N,) bool: which scans hold what the one before them holds; see `find_copies`."""
    return np.concatenate([[False], copy_of[1:] == copy_of[:-1]])


def copy_warnings(copy_of: Ints, names: Sequence[str]) -> list[str]:
    """Return what to say where a scan holds what an earlier one holds, others between them; see `find_copies`."""
    copies = np.flatnonzero((copy_of != np.arange(len(copy_of))) & ~are_repeats(copy_of))
    if not len(copies):
        return []
    copy, first = names[copies[0]], names[copy_of[copies[0]]]
    return [f"{len(copies)} scans are earlier ones once more (first: {copy} is {first}): remove the copies."]


def _glimpse(path: Path, size: int) -> bytes:
    """Return a few bytes from the middle of a file: nearly always enough to distinguish two scans."""
    with path.open("rb") as file:
        file.seek(size // 2)
        return file.read(4096)


def _require_sound(names: Sequence[str], folder: Path) -> None:
    """Raise where two scans differ in their suffix alone, a name is not text, or a scan is not a regular file."""
    known: dict[str, str] = {}
    for name in names:
        if not os.path.isfile(path := folder / name):
            raise InputError(f"{path} is not a regular file (a pipe, a device or a link to nothing); remove it")
        if not is_text(name):
            raise InputError(f"{folder} holds a scan whose name is not UTF-8, {name!a}; rename it")
        twin = known.setdefault(os.path.splitext(name)[0], name)
        if twin != name:
            raise InputError(f"{folder} holds {twin} and {name}, whose labels would have one name; remove one of them")


def _require_one_series(names: Sequence[str], stamps: Array | None, folder: Path) -> None:
    """Raise where names tell that some scans are another sensor's, or drive's: other words, and the same numbers."""
    series: dict[str, list[tuple[float, str]]] = {}
    for i, name in enumerate(names):
        if numbers := re.findall(r"\d+", stem := name[: -len(_suffix(name))]):
            at = float(numbers[-1]) if stamps is None else float(stamps[i])
            series.setdefault(re.sub(r"(?<![A-Za-z])\d+", "", stem), []).append((at, name))
    spans = sorted((min(found), max(found)) for found in series.values() if len(found) > 1)
    for one, other in pairwise(spans):
        if other[0][0] <= one[1][0]:
            raise InputError(
                f"{folder} holds scans of several sensors or drives, as their names tell ({one[0][1]}, {other[0][1]}); "
                "put those of each into a folder of its own"
            )


def _require_no_folder(folder: Path, suffix: str) -> None:
    """Raise where a folder has a scan's number: that scan would be left out in silence."""
    with os.scandir(folder) as entries:
        for entry in entries:
            stem, own = os.path.splitext(entry.name)
            if own.lower() == suffix and stem.isdecimal() and entry.is_dir():
                raise InputError(f"{folder / entry.name} is a folder among scans; rename or remove it")


def is_text(name: str) -> bool:
    """Return whether a file's name can be written down: systems allow any bytes."""
    return re.search("[\ud800-\udfff]", name) is None


def natural_key(name: str) -> tuple[list[str | int], str]:
    """Return a sort key under which numbers in names count as numbers: 1, 2, 10."""
    parts: list[str | int] = [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]
    return parts, name


def point_files(folder: Path) -> list[str]:
    """Return the names of what may be scans in a folder, text included; InputError where it cannot be read."""
    with damage_reported(folder), os.scandir(folder) as entries:
        likely = [entry for entry in entries if _suffix(entry.name) in CODEC_OF_SUFFIX and entry.name[0] != "."]
        return [entry.name for entry in likely if entry.name.lower() not in _SIDE_FILES and not entry.is_dir()]


def _suffix(name: str) -> str:
    return os.path.splitext(name)[1].lower()
