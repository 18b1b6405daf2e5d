"""Folders that may be anywhere fsspec reaches: a disk, S3, Google's or Azure's store, a web server.

Stores fail for seconds and come back: every request is made again, with growing pauses, for two minutes. What cannot
pass (no such object, no permission, a full disk) is reported at once. Credentials are the environment's, found by the
stores' own libraries; they are in no address that is shown or written down.
"""

import errno
import hashlib
import logging
import re
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, TypeVar

from automos.core.errors import AutomosError, InputError, MissingExtraError
from automos.core.extras import import_extra, pip_install
from automos.core.parallel import map_in_order
from automos.core.reading import parse_url

_log = logging.getLogger(__name__)
Item = TypeVar("Item")
Found = TypeVar("Found")

PATIENCE_S = 120.0
_THREADS = 8
_LASTING = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM}
_EXTRAS = {"gs": "gcs", "gcs": "gcs", "az": "azure", "abfs": "azure", "abfss": "azure"}


class StoreError(AutomosError):
    """A store that did not answer; it may later."""


@dataclass(frozen=True)
class Entry:
    """One file: its path below what was listed ('' where that is the file), bytes, what changes when it does."""

    path: str
    size: int
    version: str


def is_url(text: str) -> bool:
    """Return whether `text` is an address of a store, and not a path."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", text) is not None


def join(base: str, *parts: str) -> str:
    """Return the path or URL of `parts` below `base`."""
    return "/".join([base.rstrip("/"), *(part.strip("/") for part in parts if part)])


def shown(url: str) -> str:
    """Return `url` without what may be secret: user, password, query."""
    if not is_url(url):
        return url
    parts = parse_url(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"


def key_of(text: str) -> str:
    """Return a short name for `text` that can be a file's."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def of_each(action: Callable[[Item], Found], items: Iterable[Item]) -> list[Found]:
    """Return action(item) for each of `items`, in order; several at a time, since what takes long is to wait."""
    return list(map_in_order(action, items, _THREADS, threads=True))


class Store:
    """The files below one path or URL."""

    def __init__(self, url: str):
        """Raise InputError if `url` is of no known kind, MissingExtraError if its package is not installed."""
        self.url = url
        self._fs, self.root = _open(url)

    def entries(self) -> list[Entry]:
        """Return all files below, in order of their paths; one with an empty path where the URL is a file's."""
        found = sorted(self.details().items(), key=itemgetter(0))
        return [Entry(path, int(info.get("size") or 0), _version(info)) for path, info in found]

    def some_entries(self) -> list[Entry]:
        """Return them; InputError where there are none."""
        if not (entries := self.entries()):
            raise InputError(f"{shown(self.url)} holds nothing; check the address")
        return entries

    def details(self) -> dict[str, dict[str, Any]]:
        """Return what the store says of each file, by its path below."""
        found = patiently(self._find, f"listing {shown(self.url)}")
        return {path[len(self.root.rstrip("/")) :].lstrip("/"): info for path, info in found.items()}

    def get(self, path: str, local: str) -> None:
        """Copy a file to `local`."""
        patiently(lambda: self._fs.get_file(join(self.root, path), local), f"reading {shown(join(self.url, path))}")

    def put(self, local: str, path: str) -> None:
        """Copy `local` to a file."""
        patiently(lambda: self._fs.put_file(local, join(self.root, path)), f"writing {shown(join(self.url, path))}")

    def read(self, path: str) -> bytes | None:
        """Return a file's contents, None if there is none."""

        def read() -> bytes | None:
            with suppress(FileNotFoundError):
                return bytes(self._fs.cat_file(join(self.root, path)))
            return None

        return patiently(read, f"reading {shown(join(self.url, path))}")

    def write(self, path: str, contents: bytes) -> None:
        """Write a file."""
        patiently(lambda: self._fs.pipe_file(join(self.root, path), contents), f"writing {shown(join(self.url, path))}")

    def remove(self, paths: list[str]) -> None:
        """Remove files; those that are not there do not matter."""

        def remove() -> None:
            for path in paths:
                with suppress(FileNotFoundError):
                    self._fs.rm_file(join(self.root, path))

        patiently(remove, f"removing from {shown(self.url)}")

    def _find(self) -> dict[str, dict[str, Any]]:
        self._fs.invalidate_cache()
        found = self._fs.find(self.root, detail=True)
        if not found and self._fs.isfile(self.root):
            return {self.root: self._fs.info(self.root)}
        return {path: info for path, info in found.items() if info.get("type", "file") == "file"}


def patiently(action: Callable[[], Found], what: str) -> Found:
    """Return action(), done again while the store fails in ways that may pass.

    Raises
    ------
    InputError : what cannot pass, `what` named.
    StoreError : the store did not recover in time.
    """
    deadline, pause = time.monotonic() + PATIENCE_S, 0.5
    while True:
        try:
            return action()
        except AutomosError:
            raise
        except FileNotFoundError:
            raise InputError(f"{what} failed: it does not exist; check the address") from None
        except Exception as error:
            if _is_lasting(error):
                raise InputError(
                    f"{what} failed: {_reason(error)}; put that right and run the same command again"
                ) from None
            if not _is_of_store(error):
                raise
            if time.monotonic() + pause > deadline:
                raise StoreError(f"{what} failed for {PATIENCE_S:.0f} s, last with: {_reason(error)}") from None
            _log.info("%s failed (%s), once more in %.1f s", what, _reason(error), pause)
            time.sleep(pause)
            pause = min(2.0 * pause, 10.0)


def _is_lasting(error: Exception) -> bool:
    names = {kind.__name__ for kind in type(error).__mro__}
    return (
        isinstance(error, PermissionError)
        or getattr(error, "errno", None) in _LASTING
        or bool(names & {"NoCredentialsError", "PartialCredentialsError", "ParamValidationError", "NoSuchBucket"})
    )


def _is_of_store(error: Exception) -> bool:
    rooms = {kind.__module__.partition(".")[0] for kind in type(error).__mro__}
    return isinstance(error, (OSError, TimeoutError)) or bool(
        rooms & {"botocore", "aiobotocore", "aiohttp", "asyncio", "gcsfs", "google", "azure", "requests", "urllib3"}
    )


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return re.sub(r"(://)[^/\s@]*@|\?[^\s'\")]+", r"\1", text)[:300]


def _open(url: str) -> tuple[Any, str]:
    fsspec = import_extra("fsspec", "scale", "reading from stores needs {}; run: {}")
    scheme = url.partition("://")[0] if is_url(url) else "file"
    retries = {"max_attempts": 3, "mode": "standard"}
    of_s3: dict[str, Any] = {"config_kwargs": {"connect_timeout": 10, "read_timeout": 30, "retries": retries}}
    try:
        return fsspec.url_to_fs(url, **(of_s3 if scheme in ("s3", "s3a") else {}))
    except ImportError:
        extra = _EXTRAS.get(scheme, "scale")
        raise MissingExtraError(f"{scheme}:// needs another package; run: {pip_install(extra)}") from None
    except ValueError as error:
        raise InputError(f"{shown(url)} cannot be opened: {_reason(error)}") from None


def _version(info: dict[str, Any]) -> str:
    names = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "updated", "mtime")
    return next((str(info[name]) for name in names if info.get(name) is not None), "")
