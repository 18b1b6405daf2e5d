"""The log of a review: one line of JSON per action of a person, append only.

Each line names the points it is about, as rows of scans. These belong to the recording: they are the same in every run,
whatever its settings, poses or track numbers. The field `kind` distinguishes lines: decisions on tracks have none,
objects made by a person are "amendment", answers on a random sample are "answer".
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

from automos.core.errors import InputError
from automos.core.reading import DAMAGE, damage_reported, parse_json, read_text, require_regular

LOG_FILE = "review.jsonl"
CHANGE_NOTHING = ("answer", "dismissed")
"""Kinds of lines after which all labels are as they were."""
T = TypeVar("T")
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
    if (folder / LOG_FILE).exists():
        require_regular(folder / LOG_FILE)
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
    with _APPENDING:
        try:
            _append(folder / LOG_FILE, text.encode())
        except OSError as error:
            raise InputError(f"{folder / LOG_FILE} cannot be written ({error.strerror}): free some space") from error


def _append(path: Path, text: bytes) -> None:
    """Add `text` to a file, on disk when this returns; where that fails, nothing of it stays."""
    with path.open("ab", buffering=0) as file:
        size = file.tell()
        line = b"\n" + text if size and not _ends_whole(path) else text  # after a line cut short by a crash
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

    Raises
    ------
    InputError
        A line that is not `what`. Lines cut short by a crash, without their closing brace, are skipped.
    """
    path = folder / LOG_FILE
    if not path.exists():
        return []
    found = []
    with damage_reported(path, "is not a log of a review"):
        lines = read_text(path).split("\n")
    for number, line in enumerate(lines, start=1):
        if not line.strip().endswith("}"):
            continue
        try:
            fields = parse_json(line)
            if fields.pop("kind", None) == kind:
                found.append(parse(fields))
        except DAMAGE as error:
            raise InputError(
                f"{path}, line {number} is not {what} ({' '.join(str(error).split())[:200]}); "
                "correct or remove that line"
            ) from None
    return found


def key_of_changes(folder: Path) -> str:
    """Return what changes with every line of the log in `folder` that changes labels; "" where there is none."""
    path = folder / LOG_FILE
    if not path.exists():
        return ""
    with damage_reported(path, "is not a log of a review"):
        lines = [line for line in read_text(path).split("\n") if line.strip().endswith("}")]
        kept = [line for line in lines if parse_json(line).get("kind") not in CHANGE_NOTHING]
    return f"-{zlib.crc32(chr(10).join(kept).encode()):08x}" if kept else ""


def _ends_whole(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
