"""Commands under a memory limit (`ulimit -v` or `-d`), which compiled code does not survive when it is reached.

LLVM, which loads what numba compiled, aborts or deadlocks when it gets no memory. Under a limit that is too low for the
code alone, nothing is started. Under any other limit the command runs in a child process, so that this process can
report how it ended.
"""

import ctypes
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

_M_ARENA_MAX = -8
"""What glibc's mallopt calls the number of heaps."""
LEAST_MEMORY = 800 << 20
"""Bytes; eight scans of 64 beams need 610 MB of address space and 330 MB of data, 660 and 380 where it is compiled."""
_FATAL = ("SIGABRT", "SIGSEGV", "SIGBUS", "SIGKILL", "SIGILL", "SIGTRAP")
"""What a process ends by that gets no memory."""
_is_waited_for = False
"""Whether this process is the one that another waits for."""
_DIES_WITH_CALLER = 1
"""What Linux's prctl calls the signal that a process gets when the one that started it ends."""


def share_heap() -> None:
    """Let all threads of this process take memory from one heap, so that each can use what another has given back.

    glibc gives threads heaps of their own, in which a stream's arrays leave a hundred megabytes of gaps. Elsewhere
    nothing happens. It holds for the whole process, so only our own commands ask for it.
    """
    with suppress(OSError, AttributeError, TypeError):  # no glibc
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def require_memory(report: Callable[[str], NoReturn]) -> None:
    """Call `report` with a sentence if this process may have too little memory, or ends because of it."""
    limits = _limits()
    if min(limits, default=LEAST_MEMORY) < LEAST_MEMORY:
        report(
            f"this process may have {min(limits) >> 20} MB of memory and needs {LEAST_MEMORY >> 20}: "
            "raise ulimit -v, -d"
        )
    if limits and not _is_waited_for and hasattr(signal, "sigwaitinfo"):
        _go_on_in_another_process(report)


def _limits() -> list[int]:
    """Return the limits of this process's memory, in bytes."""
    try:
        import resource
    except ImportError:  # Windows limits no process so
        return []
    limits = [resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return [limit for limit in limits if limit != resource.RLIM_INFINITY]


def _go_on_in_another_process(report: Callable[[str], NoReturn]) -> None:
    """Return in a new process, and exit with its code; call `report` if it crashes.

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
            report(
                f"there was not enough memory for this, and compiled code ended the process ({name}): raise ulimit -v, "
                "-d, give smaller recordings or fewer --workers"
            )
        os._exit(code if code >= 0 else 128 - code)
