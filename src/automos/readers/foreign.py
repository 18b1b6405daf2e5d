"""Calls of libraries that others wrote, on files that came from anywhere: ended when they take too long or too much.

A damaged file can make a library loop for ever or ask for more memory than there is. Where it loops in Python, it is
interrupted and reported, as any damage is. Where it does not come back from compiled code, nothing in the same
process can stop it but its end: under the command line, and in workers that it started, that is a sentence and exit
code 2; in a program of somebody else the exception waits until the library comes back.
"""

import ctypes
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from automos.core.errors import InputError
from automos.core.working_folder import OURS

PATIENCE = 60.0
"""Seconds of a core that a call may take, and as many more as its file is read at `SLOWEST`."""
SLOWEST = 2e6
"""Bytes per second."""
GRACE = 10.0
"""Seconds from the interruption until the process is ended."""
TICK = 1.0
"""Seconds between looks."""


SENTENCE = "{} keeps its reader busy without end; it is damaged: copy it again"


class TookTooLongError(BaseException):
    """Raised in the thread that waits for a library, which must not take it for an error of its own."""


class ByThread(threading.local):
    """What each thread opens for itself, as readers are not made to be shared; another process begins anew."""

    def __reduce__(self) -> tuple[type, tuple[()]]:
        return ByThread, ()


@dataclass
class _Call:
    path: Path
    left: float
    is_interrupted: bool = False


_calls: dict[int, _Call] = {}
_gate = threading.Lock()


@contextmanager
def limited(path: Path) -> Iterator[None]:
    """Have what is called in the block come back in time and within the machine's memory.

    Raises
    ------
    InputError
        It did not; a `MemoryError` is what the library raises, if it does.
    """
    thread = threading.get_ident()
    if thread in _calls:  # a call within a call has the time of the outer one
        yield
        return
    call = _Call(path, PATIENCE + _size(path) / SLOWEST)
    with _gate:
        _calls[thread] = call
        _watch()
    try:
        with _memory():
            yield
        with _gate:
            del _calls[thread]
        if call.is_interrupted:
            time.sleep(2.0 * TICK)  # it came back just now; what interrupts it is on its way
    except TookTooLongError:
        raise InputError(SENTENCE.format(path)) from None
    finally:
        with _gate:
            _calls.pop(thread, None)


def _size(path: Path) -> int:
    with suppress(OSError):
        files = [entry for entry in os.scandir(path) if entry.is_file()] if path.is_dir() else [path]
        return sum(file.stat().st_size for file in files)
    return 0


# ---------------------------------------------------------------------------------------------------------- time
@cache
def _watch() -> None:
    """Have a thread look after the calls of this process, one for all."""
    threading.Thread(target=_look, daemon=True, name="automos-foreign").start()


def _forget() -> None:
    """Begin anew in a forked process: the threads whose calls and whose lock it inherits are not in it."""
    global _gate
    _gate = threading.Lock()
    _calls.clear()
    _held.clear()
    _watch.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def _look() -> None:
    before = time.monotonic(), time.process_time()
    while True:
        time.sleep(TICK)
        now = time.monotonic(), time.process_time()
        with _gate:
            for thread, call in _calls.items():
                # one that waits for a core, or was stopped for a while, is not taken for one that was busy
                call.left -= min(now[0] - before[0], now[1] - before[1])
                if call.left < 0.0:
                    call.is_interrupted = True
                    interrupt = ctypes.c_ulong(thread), ctypes.py_object(TookTooLongError)
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(*interrupt)
                if call.left < -GRACE and OURS.keys() <= os.environ.keys():
                    sys.stderr.write(f"error: {SENTENCE.format(call.path)}\n")
                    sys.stderr.flush()
                    os._exit(2)
        before = now


# -------------------------------------------------------------------------------------------------------- memory
_held: list[tuple[int, int]] = []
"""The limits that each found who is in the block: the first those of the process."""


@contextmanager
def _memory() -> Iterator[None]:
    """Keep this process from asking for more memory than the machine has, while anyone is in the block."""
    try:
        import resource

        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        kind = resource.RLIMIT_DATA
    except (ImportError, AttributeError, ValueError, OSError):  # not every system has such limits
        yield
        return
    with _gate:
        _held.append(resource.getrlimit(kind))
        if len(_held) == 1:
            lower = [limit for limit in (*_held[0], total) if limit != resource.RLIM_INFINITY]
            with suppress(ValueError, OSError):
                resource.setrlimit(kind, (min(lower), _held[0][1]))
    try:
        yield
    finally:
        with _gate, suppress(ValueError, OSError, IndexError):  # what was forked within the block has begun anew
            before = _held.pop()
            if not _held:
                resource.setrlimit(kind, before)
