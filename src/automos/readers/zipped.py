"""Recordings that lie in one file: an archive (.zip) of one, or of a scan each, and NumPy files of several scans.

An archive is unpacked into a temporary folder. A NumPy file is an array (S, N, 3 or more), or an archive with a
numbered array for each scan.
"""

import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.own_sequence import OwnSequence
from automos.core.reading import MAX_TEXT, damage_reported
from automos.readers.codecs import CODEC_OF_SUFFIX, read_columns
from automos.readers.column_names import is_time
from automos.readers.columns import Columns
from automos.readers.files import TEXT, natural_key, point_files
from automos.readers.formats import Format, digest_of_files
from automos.readers.record_layout import find_columns

_MACS = "__MACOSX/"
"""What other systems' files are packed beside what they belong to."""


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    remedy = "unpack it yourself, or copy it again"  # it may be encrypted, too
    with damage_reported(path, "cannot be unpacked", remedy), zipfile.ZipFile(path) as archive:
        yield archive


def read(path: Path) -> Columns:
    """Return the columns of the one cloud in an archive."""
    with _opened(path) as archive, tempfile.TemporaryDirectory(prefix="automos-") as folder:
        clouds = [member for member in archive.infolist() if Path(member.filename).suffix.lower() in CODEC_OF_SUFFIX]
        if len(clouds) != 1 or clouds[0].file_size > MAX_TEXT:
            raise InputError(
                f"{path} holds {len(clouds)} clouds, where a scan is one of {MAX_TEXT >> 20} MB at most; "
                "of a whole recording, give the archive itself"
            )
        cloud = Path(archive.extract(clouds[0], folder))
        codec = CODEC_OF_SUFFIX[cloud.suffix.lower()]
        with _called(str(cloud), f"{path}/{clouds[0].filename}"):
            columns = read_columns(cloud, codec, find_columns([cloud]) if codec == "bin" else "")
            return {name: np.array(column) for name, column in columns.items()}


@contextmanager
def _called(unpacked: str, packed: str) -> Iterator[None]:
    """Have errors name what is in the archive, not where it was unpacked for a while."""
    try:
        yield
    except InputError as error:
        raise InputError(str(error).replace(unpacked, packed)) from None


def _only_recording(place: Path, codec: str | None) -> Path:
    """Return the only recording in a folder, where its uppermost ones lie; the folder where there are none or more."""
    from automos.readers import NoRecordingError, find_recordings

    folders, found = [place], list[Path]()
    while folders and not found:
        for folder in folders:
            with suppress(NoRecordingError):
                found += find_recordings(folder, codec)
        folders = [p for folder in folders for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".")]
    return found[0] if len(found) == 1 else place


class ZippedSequence(OwnSequence):
    """The recording in an archive, which lies in a temporary folder for as long as this does."""

    address: Path = Path()
    """The archive."""

    def __init__(self, path: Path, codec: str | None = None):
        """Unpack the archive at `path`.

        Raises
        ------
        InputError
            It is damaged or encrypted, larger than the disk has room for, or holds no recording, or several.
        """
        from automos.readers import open_sequence

        self._folder = tempfile.TemporaryDirectory(prefix="automos-")
        place = Path(self._folder.name) / path.stem
        self._unpack(path, place)
        with _called(self._folder.name, str(path.parent)):
            super().__init__(open_sequence(_only_recording(place, codec), codec))
        self.source, self.name, self.address = path, path.stem, path

    def _unpack(self, path: Path, place: Path) -> None:
        """Write what is in the file at `path` into a new folder `place`; errors are those of `__init__`."""
        with _opened(path) as archive:
            needed, room = sum(member.file_size for member in archive.infolist()), shutil.disk_usage(place.parent).free
            if needed > 0.9 * room:
                raise InputError(f"{path} unpacks to {needed >> 20} MB, and {place.parent} has room for {room >> 20}")
            for member in archive.infolist():
                if not member.filename.startswith(_MACS):
                    member.filename = member.filename.replace("\\", "/")  # as some programs divide folders
                    archive.extract(member, place)

    @property
    def about(self) -> dict[str, str]:
        """As what is in it has it."""
        return self._given.about

    def fingerprint(self) -> str:
        """Return a text that changes when the archive does."""
        return f"{type(self).__name__}:{self.name}:{len(self)}:{digest_of_files([self.address])}"

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process gets: the folder is this one's to remove."""
        return {key: value for key, value in super().__getstate__().items() if key != "_folder"}


def _scans_of(path: Path) -> tuple[list[np.ndarray] | None, np.ndarray | None]:
    """Return the scans in a file, none where it holds one, None where that is open; and (S,) their times, if any."""
    from automos.readers.npy import WIDEST, load, stack_in

    arrays = load(path)
    clouds = {name: array for name, array in arrays.items() if array.ndim > 1 or array.dtype.names}
    stems = {name.rstrip("0123456789") for name in clouds}
    rows, columns = ({array.shape[k : k + 1] for array in clouds.values()} for k in (0, 1))
    # of few of one size, which NumPy named, one may be of points, others of what is known of them
    are_clouds = len(columns) == 1 and min(columns) >= (3,) and (len(rows) > 1 or stems != {"arr_"})
    if len(stems) == 1 < len(clouds) and (len(clouds) > WIDEST or (are_clouds and min(rows) > (WIDEST,))):
        found: list[np.ndarray] | None = [clouds[name] for name in sorted(clouds, key=natural_key)]
    else:
        found = stack_in(*clouds.values()) if len(clouds) == 1 else []
    sized = (name for name, array in arrays.items() if found and array.shape == (len(found),))
    return found, next((arrays[name] for name in sized if is_time(name)), None)


def _find_stacked(path: Path) -> list[Path]:
    """Return the file at `path`, or those in a folder that holds no others, if they hold several scans each.

    Raises
    ------
    InputError
        It is the only one, and its points do not tell how many it holds.
    """
    names = sorted(point_files(path), key=natural_key) if path.is_dir() else []
    files = [file for file in (path, *(path / name for name in names)) if file.is_file() and file.suffix not in TEXT]
    if not files or any(CODEC_OF_SUFFIX.get(file.suffix.lower()) != "npy" for file in files):
        return []
    try:
        first = _scans_of(files[0])[0]
    except InputError:
        if path.is_file():
            raise
        return []  # said when the scan is read
    if first is None and len(files) == 1:
        raise InputError(
            f"{files[0]} holds an array whose rows may be scans or parts of one, as its points do not tell: save one "
            "scan as (N, 3 or more) in a folder, and of several a file each"
        )
    shapes = {_shape_of(file) for file in files} - {None}
    return files if first and len(shapes) <= 1 else []


def _shape_of(path: Path) -> tuple[int, tuple[str, ...] | None] | None:
    """Return the axes and fields of the array in a file, by its header; None of archives and of what is damaged."""
    with suppress(OSError, ValueError, EOFError):  # reported when it is read
        array = np.load(path, mmap_mode="r") if path.suffix.lower() == ".npy" else None
        return None if array is None else (array.ndim, array.dtype.names)
    return None


class StackedSequence(ZippedSequence):
    """The scans of one file, which lie in a temporary folder, a file each, for as long as this does."""

    def _unpack(self, path: Path, place: Path) -> None:
        place.mkdir()
        scans, times = _scans_of(path)
        if not scans:
            raise InputError(f"{path} holds one scan, and others beside it hold several; keep one kind in a folder")
        for i, scan in enumerate(scans):
            np.save(place / f"{i:06d}.npy", scan)
        if times is not None:
            (place / "times.txt").write_text("\n".join(map(str, times.tolist())))


FORMATS = {
    "zipped": Format(
        layout="an archive: .zip of a recording",
        truth="that of what is in it",
        find=lambda path: [path] if path.suffix.lower() == ".zip" and path.is_file() else [],
        open=ZippedSequence,
        has_codecs=True,
    ),
    "stacked": Format(
        layout="scans in one file: .npy of shape (S, N, 3 or more), .npz of numbered arrays",
        find=_find_stacked,
        open=StackedSequence,
        has_codecs=True,
    ),
}
