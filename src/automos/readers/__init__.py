"""Readers of recordings, one module per format, imported when used. The format is recognised from the path.

A module declares its :class:`~automos.readers.formats.Format` as `FORMAT`, or several as `FORMATS`. They are tried in
the order of `FORMATS`, from the most specific to the plain folder. The codec of point files is guessed unless the user
names it. A recording inside a file or a set of tables has a path as if it were in a folder: `log.mcap/front/points`.
"""

import difflib
import importlib
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

from automos.core.claims import held_by
from automos.core.errors import InputError
from automos.core.reading import damage_reported, given_path
from automos.core.scan import Sequence
from automos.readers.codecs import CODECS, LAYOUTS, is_columns, parse_columns
from automos.readers.files import holds_point_files, holds_scans, is_text, natural_key, point_files
from automos.readers.foreign import limited
from automos.readers.formats import Format


class NoRecordingError(InputError):
    """Nothing that can be read as a recording; what looks like one and is damaged is another error."""


class LeftOutError(InputError):
    """A folder that holds scans itself, which would be left out beside the recordings in the folders below."""


FORMATS: tuple[str, ...] = (
    "zipped", "rosbag", "packets", "ouster", "argoverse2", "waymo", "nuscenes", "pandaset", "kitti_raw",
    "kitti_tracking", "helipr", "mulran", "boreas", "apollo", "helimos", "semanticposs", "kitti", "stacked",
    "folder",
)  # fmt: skip
"""Formats of recordings in the order they are tried."""
_MODULES = {
    **dict.fromkeys(("helipr", "mulran", "boreas", "apollo"), "stamped_drives"),
    **dict.fromkeys(("kitti", "helimos", "semanticposs", "kitti_tracking"), "kitti"),
    **dict.fromkeys(("zipped", "stacked"), "zipped"),
}
"""Modules that read several formats, by the formats; others read one, of their name."""


def load_format(name: str) -> Format:
    """Return what the reader `name`, one of `FORMATS`, declares of itself."""
    module = importlib.import_module(f"automos.readers.{_MODULES.get(name, name)}")
    declared: Format = module.FORMATS[name] if name in _MODULES else module.FORMAT
    return declared


def open_sequence(path: str | Path, format: str | None = None) -> Sequence:
    """Return the one recording at `path`.

    Parameters
    ----------
    path : str or Path
        A recording, or the root of a data set that holds only one.
    format : str, optional
        Layout (one of `FORMATS`), codec of the point files (one of `CODECS`), or their columns, as
        `x,y,z,intensity`, where they do not name them. Guessed if not given.

    Returns
    -------
    Sequence
        The recording. Scans are read when they are asked for.

    Raises
    ------
    InputError
        The path does not exist, holds no recording or several, the format is unknown, or a file cannot be used.

    Examples
    --------
    >>> import automos
    >>> recording = automos.open_sequence("my_log")
    >>> len(recording)
    12
    >>> recording[0].points.shape[1]
    3
    """
    found = _find(given_path(path, "a recording"), format)
    if len(found) > 1:
        names = _few(one.path.name for one in found)
        raise InputError(f"{path} holds {len(found)} recordings ({names}); give one, as {found[0].path}")
    return found[0].open()


def find_recordings(path: str | Path, format: str | None = None) -> list[Path]:
    """Return the path of each recording at `path`, sorted by name, as `open_sequence` takes it; opens none.

    Parameters and errors are those of `open_sequence`.
    """
    return [one.path for one in _find(given_path(path, "a recording"), format)]


def kind_of(path: str | Path, format: str | None = None) -> str:
    """Return what the recording at `path` is of: a data set, or a kind of log; errors are those of `open_sequence`."""
    return _find(given_path(path, "a recording"), format)[0].reader.layout.partition(":")[0].partition(";")[0]


def open_recordings(path: str | Path, format: str | None = None) -> list[Sequence]:
    """Return all recordings at `path`.

    Parameters
    ----------
    path : str or Path
        A recording, or a folder that holds recordings, such as the root of a data set.
    format : str, optional
        As for `open_sequence`.

    Returns
    -------
    list of Sequence
        The recordings, sorted by name; at least one.

    Raises
    ------
    InputError
        As for `open_sequence`, except that there may be several recordings.

    Examples
    --------
    >>> import automos
    >>> [recording.name for recording in automos.open_recordings("my_log")]
    ['my_log']
    """
    return [one.open() for one in _find(given_path(path, "a recording"), format)]


class _Found(NamedTuple):
    """A recording, the format that reads it, and the codec the user asked for."""

    path: Path
    reader: Format
    codec: str | None

    def open(self) -> Sequence:
        if not is_text(str(self.path)):
            raise InputError(f"{str(self.path)!a} is not UTF-8; rename what is not")
        with damage_reported(self.path), limited(self.path) if self.reader.needs else nullcontext():
            return self.reader.open(self.path, self.codec) if self.reader.has_codecs else self.reader.open(self.path)


def _find(path: Path, format: str | None) -> list[_Found]:
    """Return the recordings at `path`, at least one."""
    format = "packets" if format == "velodyne" else format  # what it was called as it read no others
    with damage_reported(path):
        names, codec = _resolve(format)
        for name in names:
            reader = load_format(name)
            if codec is not None and not reader.has_codecs:
                continue
            found = [_Found(recording, reader, codec) for recording in reader.find(path)]
            if found:
                return found + ([] if format in FORMATS else _others(path, found, format))
        if not path.exists():
            raise NoRecordingError(f"{path} does not exist; check the path")
        raise NoRecordingError(_nothing_found(path, format))


def _others(path: Path, found: list[_Found], format: str | None) -> list[_Found]:
    """Return the recordings of other formats that lie in folder `path` beside those `found` in it.

    Raises
    ------
    LeftOutError
        Scans lie in `path` itself, too.
    """
    recordings = {one.path for one in found}
    is_one = path in recordings
    if not path.is_dir() or (is_one and not (path / "velodyne").is_dir()):
        return []
    if holds_scans(path) and not recordings <= {path / name for name in point_files(path)}:
        raise LeftOutError(
            f"{path} holds scans itself, and others in folders below; move its own into a folder of their own, or name "
            "the format with --format"
        )
    if is_one:
        return []
    inside = {parent for one in recordings for parent in one.parents}
    others: list[_Found] = []
    for p in sorted(path.iterdir(), key=lambda p: natural_key(p.name)):
        if p not in recordings and not p.name.startswith("."):
            others += _others(p, found, format) if p in inside else _beside(p, format)
    in_parts = [one.reader for one in found if one.path.name.endswith("+")]  # of which `others` may be further ones
    return [one for one in others if one.path.parent != path or one.reader not in in_parts]


def _beside(path: Path, format: str | None) -> list[_Found]:
    """Return the recordings at `path`, none if it only looks like one, as text files that describe recordings do."""
    if not path.is_dir() or (holds_point_files(path) and not holds_scans(path)):
        return []
    try:
        return _find(path, format)
    except NoRecordingError:
        return []


def _resolve(format: str | None) -> tuple[Iterable[str], str | None]:
    if format in FORMATS:
        return [format], None
    if format is None or format in CODECS or format in LAYOUTS:
        return FORMATS, format
    if is_columns(format):
        parse_columns(format)  # raises where they are none
        return FORMATS, format
    known = [*FORMATS, *CODECS]
    near = difflib.get_close_matches(format.lower(), known, n=1, cutoff=0.0)
    raise InputError(f"unknown format {format!r}; did you mean {near[0]!r}? Known are: {', '.join(known)}")


def _nothing_found(path: Path, format: str | None) -> str:
    from automos.readers.other_files import first_known

    if path.is_file():
        if known := first_known([path]):
            return known
        if format in FORMATS:
            return f"{path} is not a recording of format {format!r} ({load_format(format).layout}); leave --format out"
        return f"{path} is a file; give the folder that holds the scans"
    entries = sorted(p for p in path.iterdir() if not p.name.startswith("."))
    if not entries:
        return f"{path} is empty; give a folder that holds scans"
    if known := first_known(entries):
        return known
    if (held := held_by(path)) is not None:
        return f"{path} holds {held} that automos wrote, and no scans: give the recording itself"
    if inner := _few(p.name for p in entries if p.is_dir() and holds_point_files(p)):
        return f"{path} holds no scans itself, but these folders in it do: {inner}; give one of them"
    what = f"no recording of format {format!r}" if format in FORMATS else "no point files"
    return f"{path} holds {what}; a recording is velodyne/*.bin, or a folder of .bin, .pcd, .ply, .npy or .xyz files"


def _few(names: Iterable[str], most: int = 5) -> str:
    names = list(names)
    return ", ".join(names[:most]) + (", ..." if len(names) > most else "")
