"""Point files whose library can crash, read in a process of its own: when it dies, a sentence names the file.

A process is kept for the next file, one for each thread that reads at a time, because starting one takes a third of a
second. It is `python -c` with pipes that no other process has: nothing of the caller's script is run again, Ctrl-C goes
past it, and it ends when its caller does, however that ends. What comes back is arrays, no pickles.
"""

from __future__ import annotations

import atexit
import ctypes
import importlib
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from automos.core.errors import InputError
from automos.core.parallel import SAFE_PATH
from automos.core.reading import damage_reported
from automos.core.working_folder import OURS
from automos.readers.columns import Columns
from automos.readers.foreign import SENTENCE

_START = "import sys; sys.path[:] = sys.argv[1:]; from automos.readers.apart import serve; serve()"
_PIPE = 1 << 20
"""Bytes that a pipe holds where that can be chosen; a scan has some megabytes."""


def read_apart(module: str, path: Path) -> Columns:
    """Return what `read_here(path)` of `automos.readers.<module>` returns in another process.

    Raises
    ------
    InputError
        As it does; also where the process dies of the file, or none can be started.
    """
    idle = _idle.setdefault(os.getpid(), [])  # a process that was forked from this one has none of its own
    with suppress(IndexError, _EndedError):  # that one may have been ended by others while it waited
        return idle.pop().read(module, path)
    try:
        return _Reader(path).read(module, path)
    except _EndedError as ended:
        if ended.code == 2:  # it took too long
            raise InputError(SENTENCE.format(path)) from None
        raise InputError(
            f"{path} ends the library that reads it ({ended}); it is damaged, or there is too little memory: "
            "copy it again"
        ) from None


class _EndedError(Exception):
    """The process is over, before it answered."""

    def __init__(self, code: int):
        self.code = code
        how = f"code {code}"
        with suppress(ValueError):
            how = f"signal {signal.Signals(-code).name}"
        super().__init__(how)


class _Reader:
    """A process that reads one file at a time."""

    def __init__(self, path: Path):
        """Start it; `path` is what it is started for."""
        places = dict.fromkeys([*sys.path, str(Path(__file__).parents[2])])
        obeyed = [place for place in places if place and not _is_working_folder(place)]
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START, *obeyed],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **SAFE_PATH, **OURS},
            )
        except OSError as error:
            raise InputError(_NOT_STARTED.format(path, error.strerror or error)) from None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._orders, self._answers = self._process.stdin, self._process.stdout
        _widen(self._answers)
        try:
            greeted = self._answers.readline()
        except BaseException:
            self.end()
            raise
        if not greeted:
            raise InputError(_NOT_STARTED.format(path, f"it ended at once, with {_EndedError(self.end())}"))

    def read(self, module: str, path: Path) -> Columns:
        """Return the columns of one file, and wait for the next; _EndedError where the process dies of it."""
        here = None
        with suppress(OSError):  # a working folder that is gone: absolute paths still lead somewhere
            here = os.getcwd()
        try:
            self._orders.write(json.dumps([module, os.fspath(path), here]).encode() + b"\n")
            self._orders.flush()
            head = self._answers.readline()
            if not head.endswith(b"\n"):
                raise EOFError
            about = json.loads(head)
            columns = {} if isinstance(about, str) else {name: self._array(*of) for name, of in about.items()}
        except (BrokenPipeError, EOFError):
            raise _EndedError(self.end()) from None
        except BaseException:  # Ctrl-C, for example: half of an answer is still on its way
            self.end()
            raise
        _idle[os.getpid()].append(self)
        if isinstance(about, str):
            raise InputError(about)
        return columns

    def _array(self, kind: str, shape: list[int]) -> np.ndarray:
        array = np.empty(shape, np.dtype(kind))
        if self._answers.readinto(array.reshape(-1).view(np.uint8)) < array.nbytes:  # type: ignore[attr-defined]
            raise EOFError
        return array

    def end(self) -> int:
        """End the process; return its exit status."""
        with suppress(OSError):
            self._orders.close()
        try:
            code = self._process.wait(0.5)
        except BaseException as why:
            self._process.kill()
            code = self._process.wait()
            if not isinstance(why, subprocess.TimeoutExpired):
                raise
        finally:
            self._answers.close()
        return code


_NOT_STARTED = "{} is read by a process of its own, which cannot be started ({}); see what this machine is short of"
_idle: dict[int, list[_Reader]] = {}
"""Readers that wait for their next file, by the process that started them."""


@atexit.register
def _end_all() -> None:
    for reader in _idle.pop(os.getpid(), []):
        reader.end()


def _is_working_folder(place: str) -> bool:
    """Return whether modules are looked for in the working folder at `place`, which is not ours to obey."""
    with suppress(OSError):
        return Path(place).samefile(".") and not Path(place).samefile(Path(__file__).parents[2])
    return False


def _widen(pipe: IO[bytes]) -> None:
    with suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE)


# ------------------------------------------------------------------------------------------- in the other process
def serve() -> None:
    """Answer orders from standard input until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is its caller's, who ends us
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash is expected here, and leaves no file
    if sys.platform == "win32":  # nor a window that asks what to do about it
        ctypes.windll.kernel32.SetErrorMode(0x0003)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is not an answer
    answers.write(b"ready\n")
    answers.flush()
    for line in sys.stdin.buffer:
        module, path, here = json.loads(line)
        with suppress(OSError):
            os.chdir(here or ".")
        about, arrays = _answer(module, path)
        answers.write(json.dumps(about).encode() + b"\n")
        for array in arrays:
            answers.write(memoryview(array.reshape(-1).view(np.uint8).data))
        answers.flush()


def _answer(module: str, path: str) -> tuple[Any, list[np.ndarray]]:
    """Return a description of a file (type and shape of each column, or what is wrong with it) and its columns."""
    read = importlib.import_module(f"automos.readers.{module}").read_here
    try:
        with damage_reported(path):
            columns = {name: np.ascontiguousarray(column) for name, column in read(Path(path)).items()}
    except InputError as error:
        return str(error), []
    return {name: (each.dtype.str, each.shape) for name, each in columns.items()}, list(columns.values())
