"""Which recordings a run is about: those in a folder, in a list, in a bucket; and which of them are this machine's."""

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path, PurePosixPath

from automos.core.errors import AutomosError, InputError
from automos.core.reading import parse_url, read_text
from automos.fleet.orders import Recording
from automos.fleet.publishing import MARKER
from automos.fleet.storage import Store, is_url, join, shown
from automos.readers import LeftOutError, NoRecordingError, find_recordings, open_sequence
from automos.readers.codecs import CODEC_OF_SUFFIX
from automos.readers.files import natural_key
from automos.readers.formats import CAPTURES

Shard = tuple[int, int]
"""i and n: every n-th recording from the i-th on, i from 0 to n - 1."""
_LISTS = {".txt", ".list"}
_LOGS = {".bag", ".mcap", *CAPTURES}
_TEXT = {".txt", ".csv"}
_COMMENT = re.compile(r"(?:^|\s)#")
"""Begins a comment; within a word it is part of a name, as of drive#2."""
_SIDE_FOLDERS = {"labels", "predictions", "confidences"}


def find_all(source: str, format: str | None = None) -> list[Recording]:
    """Return all recordings at `source`, each with a name of its own.

    Parameters
    ----------
    source : str
        A recording, a folder of recordings, a list of either (a .txt or .list file, one a line, # begins a comment,
        paths are relative to it), or the URL of a recording or of a folder of them.
    format : str, optional
        The recordings' format, if it is not recognised.

    Raises
    ------
    InputError
        Nothing is there. What is in a list is only looked at where it is a folder or a bucket.
    """
    if is_url(source):
        return _named(_in_store(source), format)
    path = Path(source)
    if path.is_file() and path.suffix.lower() in _LISTS:
        return _named(_in_list(path, format), format)
    return _named([str(found.absolute()) for found in _in_folder(path, format)], format)


def name_of(source: str) -> str:
    """Return what the results of several recordings at `source` are named after: the last part of its path.

    All of it: folders are named after days and versions, and 2026.11.25 is not 2026.11.26.
    """
    path = Path(source)
    if is_url(source) or path.name in ("", ".."):
        return _parts(source)[-1]
    return path.stem if path.is_file() and path.suffix.lower() in _LISTS else path.name


def alone(recordings: list[Recording], shard: Shard | None, target: str | None = None) -> list[Recording]:
    """Return `recordings`; one that is all there is gets the run's folder for itself.

    Not where the run at path `target` had several, of which one is left: its results have a folder there.
    """
    if len(recordings) != 1 or shard is not None:
        return recordings
    had_others = target is not None and Path(recordings[0].target(target), MARKER).exists()
    return recordings if had_others else [replace(recordings[0], folder="")]


def describe(recording: Recording) -> str:
    """Return what is known of a recording without fetching it."""
    if is_url(recording.source):
        return f"from {shown(recording.source)}"
    try:
        return f"{len(open_sequence(recording.source, recording.format))} scans from {recording.source}"
    except AutomosError as error:
        return str(error)


def take_shard(recordings: list[Recording], shard: Shard | None) -> list[Recording]:
    """Return those of `recordings` that are in a shard, all where there is none."""
    return recordings if shard is None else recordings[shard[0] :: shard[1]]


def parse_shard(text: str | None) -> Shard | None:
    """Return (i, n) of the text "i/n".

    Raises
    ------
    InputError : it is none.
    """
    if text is None:
        return None
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if found is None or int(found[1]) >= int(found[2]):
        raise InputError(f"--shard {text} is none: write i/n with i from 0 to n - 1, as 0/8 ... 7/8")
    return int(found[1]), int(found[2])


def _in_folder(path: Path, format: str | None) -> list[Path]:
    """Return the recordings of a folder, or of the folders in it."""
    try:
        return find_recordings(path, format)
    except InputError as error:
        if isinstance(error, LeftOutError) or not path.is_dir():
            raise
        inner = sorted((p for p in path.iterdir() if not p.name.startswith(".")), key=lambda p: natural_key(p.name))
        found = [recording for p in inner for recording in _recordings_at(p, format)]
        if not found:
            raise
        return found


def _recordings_at(path: Path, format: str | None) -> list[Path]:
    """Return the recordings at `path`; `path` itself if they cannot be listed, so that it is reported later."""
    try:
        return find_recordings(path, format) if path.is_dir() or path.suffix.lower() in _LOGS else []
    except NoRecordingError:
        return []
    except InputError:
        return [path]


def _in_list(path: Path, format: str | None) -> list[str]:
    """Return the recordings that the lines of a list name; one that is not there is found out later."""
    try:
        lines = [_COMMENT.split(line)[0].strip() for line in read_text(path).splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as a list of recordings: {error}") from None
    found: list[str] = []
    for line in filter(None, lines):
        if not line.isprintable():
            raise InputError(f"{path} names {line[:80]!r}, which is not a path; write a path or URL in each line")
        if is_url(line):
            found += _in_store(line)
            continue
        entry = (path.parent / line).absolute()
        try:
            found += map(str, _in_folder(entry, format))
        except InputError:
            found.append(str(entry))
    if not found:
        raise InputError(f"{path} names no recordings: write a path or URL in each line")
    return found


def _in_store(url: str) -> list[str]:
    """Return the URLs of the recordings below `url`: logs, and folders of scans; `url` itself where none is seen."""
    found: dict[str, None] = {}
    for entry in Store(url).some_entries():
        path = PurePosixPath(entry.path)
        folders = path.parts[:-1]
        suffix = path.suffix.lower()
        if suffix in CAPTURES:  # its description lies beside it
            found["/".join(folders)] = None
        elif suffix in _LOGS:
            found[entry.path] = None
        elif "velodyne" in folders:
            found["/".join(folders[: folders.index("velodyne")])] = None
        elif suffix in CODEC_OF_SUFFIX and suffix not in _TEXT and not _SIDE_FOLDERS & set(folders):
            found["/".join(folders)] = None
    base, _, query = url.partition("?")
    rest = f"?{query}" if query else ""
    return [join(base, path) + rest for path in sorted(found, key=natural_key) or [""]]


def _named(found: Iterable[str], format: str | None) -> list[Recording]:
    """Return recordings named after the last part of their paths, or of more parts where that is not theirs alone."""
    sources = list(dict.fromkeys(found))
    parts = [_parts(source) for source in sources]
    lengths = [1] * len(parts)
    while True:
        names = ["__".join(p[-n:]) for p, n in zip(parts, lengths, strict=True)]
        counts = Counter(names)
        twice = next((name for name, count in counts.items() if count > 1), None)
        if twice is None:
            return [Recording(name, source, format) for name, source in zip(names, sources, strict=True)]
        before, wanted = lengths, [n + (counts[name] > 1) for n, name in zip(lengths, names, strict=True)]
        lengths = [min(n, len(p)) for n, p in zip(wanted, parts, strict=True)]
        if lengths == before:
            raise InputError(f"two recordings would both be named {twice}: label them into different --out folders")


def _parts(source: str) -> tuple[str, ...]:
    if is_url(source):
        address = parse_url(source)
        parts = (address.netloc.rpartition("@")[2], *PurePosixPath(address.path.strip("/")).parts)
    else:
        parts = Path(source).resolve().parts[1:]
    if not parts:
        raise InputError(f"{source} is all of this machine, and no recording: name the folder of one")
    *folders, last = parts
    return (*folders, PurePosixPath(last).stem if PurePosixPath(last).suffix.lower() in _LOGS else last)
