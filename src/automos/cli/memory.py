"""Commands under a limit of memory (ulimit -v, -d): compiled code does not survive that there is none.

LLVM, which loads what numba compiled, ends the process when there is no memory for it, or waits for itself. Under a
limit below what the code alone needs nothing is begun; under any other the command runs in a process that this one
waits for, to say what became of it.
"""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

LEAST_MEMORY = 800 << 20
"""Bytes; eight scans of 64 beams need 610 MB of address space and 330 MB of data, 660 and 380 where it is compiled."""
_FATAL = ("SIGABRT", "SIGSEGV", "SIGBUS", "SIGKILL", "SIGILL", "SIGTRAP")
"""What a process ends by that gets no memory."""
_is_waited_for = False
"""Whether this process is the one that another waits for."""
_DIES_WITH_CALLER = 1
"""What Linux's prctl calls the signal that a process gets when the one that started it ends."""


def require_memory(tell: Callable[[str], NoReturn]) -> None:
    """Call `tell` with a sentence where this process may have too little memory, or ends for want of it."""
    limits = _limits()
    if min(limits, default=LEAST_MEMORY) < LEAST_MEMORY:
        tell(
            f"this process may have {min(limits) >> 20} MB of memory and needs {LEAST_MEMORY >> 20}: "
            "raise ulimit -v, -d"
        )
    if limits and not _is_waited_for and hasattr(signal, "sigwaitinfo"):
        _go_on_in_another_process(tell)


def _limits() -> list[int]:
    """Return the limits of this process's memory, in bytes."""
    try:
        import resource
    except ImportError:  # Windows limits no process so
        return []
    limits = [resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return [limit for limit in limits if limit != resource.RLIM_INFINITY]


def _go_on_in_another_process(tell: Callable[[str], NoReturn]) -> None:
    """Return in a new process, whose end this one waits for and takes for its own; of a crash it calls `tell`.

    What is sent to this process is passed on, but for what a terminal sends to both.
    """
    global _is_waited_for
    waited_for = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGCHLD}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, waited_for)
    process = os.fork()
    if not process:
        _is_waited_for = True
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_DIES_WITH_CALLER, signal.SIGKILL)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return
    while True:
        sent = signal.sigwaitinfo(waited_for)
        if sent.si_signo != signal.SIGCHLD:
            if sent.si_code <= 0 or sent.si_signo != signal.SIGINT:
                os.kill(process, sent.si_signo)
            continue
        ended, status = os.waitpid(process, os.WNOHANG)
        if not ended:
            continue
        code = os.waitstatus_to_exitcode(status)
        name = signal.Signals(-code).name if code < 0 else ""
        if name in _FATAL:
            tell(
                f"there was not enough memory for this, and compiled code ended the process ({name}): raise ulimit -v, "
                "-d, give smaller recordings or fewer --workers"
            )
        os._exit(code if code >= 0 else 128 - code)
