"""Keeps a stream whole: one caller at a time, and no silence after a step that was left in the middle."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from automos.core.blas import one_blas_thread
from automos.core.errors import InputError


class Guard:
    """Knows whether somebody is pushing, and whether a step was interrupted."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.is_broken = False

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Raise InputError if another thread is in the block, or the caller itself, as in the middle of `push_each`."""
        if not self._lock.acquire(blocking=False):
            raise InputError(
                "scans are pushed into this Labeler already, by another thread or push_each: push from one at a time, "
                "or give each a Labeler of its own"
            )
        try:
            yield
        finally:
            self._lock.release()

    @contextmanager
    def step(self) -> Iterator[None]:
        """Raise InputError if an earlier block was left by an exception, as by Ctrl-C; note whether this one is."""
        if self.is_broken:
            raise InputError("an earlier call was interrupted in the middle of a scan: call finish, then begin anew")
        try:
            with one_blas_thread():
                yield
        except BaseException:
            self.is_broken = True
            raise
