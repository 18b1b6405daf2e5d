"""Copies of recordings on a worker's own disk, bounded in size and shared by the workers of a machine.

A copy is made whole or does not count. While somebody reads it, it is locked, and stays; room for another is made by
removing those unused for longest. Files keep the store's times, so that a recording fetched again is the same one.
"""

import json
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from automos.core.claims import COPIES, claim
from automos.core.errors import InputError
from automos.fleet.storage import Entry, Store, key_of, of_each, shown

_POLL_S = 0.5


class Cache:
    """A folder of copies, of at most `limit` bytes together."""

    def __init__(self, folder: Path, limit: int):
        """Take a folder; it is made when first needed."""
        self._folder, self._limit = folder, limit

    def stamp_of(self, url: str) -> str:
        """Return a text that changes when anything at `url` does; nothing is fetched for it."""
        return _stamp(Store(url).entries())

    @contextmanager
    def copy_of(self, url: str) -> Iterator[Path]:
        """Give the path of a copy of what lies at `url`, fetched if it is not here; it stays until the block ends.

        Raises
        ------
        InputError : nothing is there, or it is larger than the whole cache.
        StoreError : the store did not answer.
        """
        store = Store(url)
        entries = store.some_entries()
        key, size = key_of(f"{store.url}\n{_stamp(entries)}"), sum(entry.size for entry in entries)
        if size > self._limit:
            raise InputError(
                f"{shown(store.url)} has {size / 1e9:.1f} GB, but copies may take {self._limit / 1e9:.1f} GB: "
                "give more with --cache"
            )
        claim(self._folder, COPIES)
        done = self._folder / f"{key}.json"
        with self._lock(key) as lock:
            while not (_take(lock, alone=False) and done.exists()):
                _take(lock)  # others fetch it just now, or nobody has
                if not done.exists():
                    self._make_room(key, size)
                    _fetch(store, entries, self._folder / key)
                    done.write_text(json.dumps({"url": shown(store.url), "bytes": size}))
            os.utime(done)
            yield _data(self._folder / key, store)

    def _make_room(self, key: str, size: int) -> None:
        """Reserve `size` bytes for `key`, removing copies that nobody reads; wait until there is room."""
        while True:
            with self._lock("room") as lock:
                _take(lock)
                taken = {path.stem: int(path.read_text() or 0) for path in self._folder.glob("*.bytes")}
                taken.pop(key, None)
                for old in sorted(taken, key=self._last_use):
                    if sum(taken.values()) + size > self._limit and self._remove_unused(old):
                        del taken[old]
                if sum(taken.values()) + size <= self._limit:
                    (self._folder / f"{key}.bytes").write_text(str(size))
                    return
            time.sleep(_POLL_S)

    def _last_use(self, key: str) -> float:
        done = self._folder / f"{key}.json"
        return done.stat().st_mtime if done.exists() else 0.0

    def _remove_unused(self, key: str) -> bool:
        with self._lock(key) as lock:
            if not _take(lock, wait=False):
                return False
            (self._folder / f"{key}.json").unlink(missing_ok=True)
            shutil.rmtree(self._folder / key, ignore_errors=True)
            (self._folder / f"{key}.bytes").unlink(missing_ok=True)
            return True

    def _lock(self, key: str) -> IO[str]:
        return (self._folder / f"{key}.lock").open("w")  # closing it lets go


def _take(lock: IO[str], wait: bool = True, alone: bool = True) -> bool:
    """Lock a file, `alone` or together with others who read; return whether it could be done without waiting."""
    try:
        import fcntl
    except ImportError:  # Windows
        raise InputError(
            "copies of recordings are shared under locks that this system has not: copy the recordings to a disk, and "
            "label them there"
        ) from None
    try:
        fcntl.flock(lock, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    return True


def _stamp(entries: list[Entry]) -> str:
    return key_of("\n".join(f"{entry.path}\0{entry.size}\0{entry.version}" for entry in entries))


def _data(folder: Path, store: Store) -> Path:
    return folder / (PurePosixPath(store.root.rstrip("/")).name or "recording")


def _fetch(store: Store, entries: list[Entry], folder: Path) -> None:
    """Copy `entries` below `folder`, checked for size; a file's time follows from its version in the store."""
    shutil.rmtree(folder, ignore_errors=True)
    root = _data(folder, store)

    def fetch(entry: Entry) -> None:
        local = root / entry.path if entry.path else root
        if not local.resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{shown(store.url)} holds a file named {entry.path!r}; rename it")
        local.parent.mkdir(parents=True, exist_ok=True)
        store.get(entry.path, str(local))
        if entry.size and local.stat().st_size != entry.size:
            raise OSError(f"{local.name} came with {local.stat().st_size} bytes of {entry.size}")
        os.utime(local, (0, int(key_of(entry.version), 16) % 2**31))

    of_each(fetch, entries)
