"""The log of a review: one line of JSON per action of a person, append only.

Each line names the points it is about, as rows of scans. These belong to the recording: they are the same in every run,
whatever its settings, poses or track numbers. The field `kind` distinguishes lines: decisions on tracks have none,
objects made by a person are "amendment", answers on a random sample are "answer".
"""

import errno
import json
import logging
import os
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

from pydantic import TypeAdapter

from automos.core.errors import InputError
from automos.core.reading import DAMAGE, MAX_TEXT, checked, damage_reported, parse_json, read_bytes, require_regular

LOG_FILE = "review.jsonl"
CHANGE_NOTHING = ("answer", "dismissed")
"""Kinds of lines after which all labels are as they were."""
T = TypeVar("T")
_FIELDS = TypeAdapter(dict[str, Any])
_log = logging.getLogger(__name__)
_APPENDING = Lock()
"""Answers and decisions come from several threads."""


def now() -> str:
    """Return the time in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def append_lines(folder: Path, lines: Iterable[dict[str, Any]]) -> None:
    """Add `lines` to the log in `folder`, on disk when this returns.

    Raises
    ------
    InputError
        The log cannot be written.
    """
    path = folder / LOG_FILE
    if path.exists():
        require_regular(path)
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines).encode()
    with _APPENDING:
        if len(text) + (path.stat().st_size if path.exists() else 0) >= MAX_TEXT:  # what is larger is not read
            raise InputError(f"{path} is full ({MAX_TEXT >> 20} MB): label and review the recording in shorter pieces")
        try:
            _append(path, text)
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}): free some space") from error


def _append(path: Path, text: bytes) -> None:
    """Add `text` to a file, on disk when this returns; where that fails, nothing of it stays."""
    with path.open("ab+", buffering=0) as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        line = text if file.read(1) in (b"\n", b"") else b"\n" + text  # after a line cut short by a crash
        try:
            if file.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(file.fileno())
        except OSError:
            with suppress(OSError):
                file.truncate(size)
            raise


def read_lines(folder: Path, kind: str | None, what: str, parse: Callable[[dict[str, Any]], T]) -> list[T]:
    """Return what `parse` makes of the lines of one `kind` in the log of `folder`, oldest first; [] without a log.

    A line that is not `what` is passed over with a warning, and stays.

    Raises
    ------
    InputError
        The log cannot be read.
    """
    found = []
    for number, _, fields in _lines(folder):
        if fields.pop("kind", None) == kind:
            try:
                found.append(parse(fields))
            except DAMAGE as error:
                _warn(folder, number, what, error)
    return found


def key_of_changes(folder: Path) -> str:
    """Return what changes with every line of the log in `folder` that changes labels; "" where there is none."""
    kept = [line for _, line, fields in _lines(folder) if fields.get("kind") not in CHANGE_NOTHING]
    joined = b"\n".join(kept)
    return f"-{zlib.crc32(joined):08x}" if kept else ""


def _lines(folder: Path) -> Iterator[tuple[int, bytes, dict[str, Any]]]:
    """Yield the number, the text and the fields of each line of the log in `folder`; warn of those that are broken."""
    path = folder / LOG_FILE
    if not path.exists():
        return
    with damage_reported(path):
        lines = read_bytes(path, MAX_TEXT).split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            fields = checked(_FIELDS, parse_json(line))
        except DAMAGE as error:
            _warn(folder, number, "a line of a review", error)
        else:
            yield number, line, fields


def _warn(folder: Path, number: int, what: str, error: Exception) -> None:
    _log.warning(
        "%s, line %d is not %s (%s): it stays, but is passed over; correct it and label again to have it applied",
        folder / LOG_FILE, number, what, " ".join(str(error).split())[:200],
    )  # fmt: skip
