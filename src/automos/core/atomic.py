"""Files that are written completely or not at all."""

import errno
import io
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.claims import require_within
from automos.core.errors import InputError


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; it replaces `path` when the block ends without error.

    Raises
    ------
    InputError : the disk is full or the folder cannot be written; nothing half-written stays. Or `path` is not a file.
    """
    if path.name in ("", "..") or _is_special(path):
        raise InputError(f"{path} is a folder, a device or the like: give the name of a file to write")
    if os.path.lexists(path):
        require_within(path)
    # Not the process's number: that of another container, or of another thread, may be the same.
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"{path} could not be written ({error.strerror or error}): {_remedy(error)}, then run the same command "
            "again; it goes on where it stopped"
        ) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _is_special(path: Path) -> bool:
    """Return whether `path` is there and no plain file; who may write in /dev would replace its devices and streams."""
    is_stream = path.is_symlink() and os.readlink(path).startswith("/proc/")  # /dev/stdout
    return is_stream or (path.exists() and not path.is_file())


def _remedy(error: OSError) -> str:
    if error.errno == errno.ENAMETOOLONG:
        return "give scans or folders shorter names"
    if is_full(error):
        return "free some space or choose another --out"
    return "choose another --out, or allow writing there"


def is_full(error: OSError) -> bool:
    """Return whether there was no space left, or none that its writer may use."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def held(folder: Path, waits: bool = False) -> Iterator[None]:
    """Make `folder` and keep other processes from writing into it until the block ends.

    Raises
    ------
    InputError : another one does (with `waits` its end is waited for), or the folder cannot be made.
    """
    with faults_reported(folder):
        folder.mkdir(parents=True, exist_ok=True)
    try:
        import fcntl
    except ImportError:  # Windows has no locks on folders
        yield
        return
    with faults_reported(folder):
        handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError) if waits else nullcontext():
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
    except BlockingIOError:
        os.close(handle)
        raise InputError(f"another process writes into {folder}: wait for it, end it, or write elsewhere") from None
    except OSError:  # a file system without locks
        pass
    try:
        yield
    finally:
        os.close(handle)


@contextmanager
def faults_reported(path: Path) -> Iterator[None]:
    """Raise InputError that names `path` where it cannot be written in the block."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}): choose another --out") from error


def remove_parts(folder: Path) -> None:
    """Remove what a killed process left half-written in `folder` and below, but not through links."""
    for part in folder.rglob(f".*.{'[0-9a-f]' * 8}.part"):
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path`, completely or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any, indent: int | None = None) -> None:
    """Write `value` to `path` as JSON, completely or not at all."""
    write_text(path, json.dumps(value, indent=indent))


def write_bytes(path: Path, content: bytes | memoryview) -> None:
    """Write `content` to `path`, completely or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_raw(path: Path, array: npt.NDArray) -> None:
    """Write the numbers of `array` and nothing else to `path`, whole or not at all.

    `ndarray.tofile`, and `numpy.save` to a file, say nothing where the disk is full when their file is closed.
    """
    write_bytes(path, np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)


def write_npy(path: Path, array: npt.NDArray) -> None:
    """Write `array` to `path` as NumPy's file, whole or not at all; see `write_raw`."""
    content = io.BytesIO()
    np.save(content, array)
    write_bytes(path, content.getbuffer())
