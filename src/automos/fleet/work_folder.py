"""What a worker knows of the machine it runs on, and its folder for copies and for results on their way to a store.

The folder is the user's own, and gone at the end. By default it lies in the system's temporary folder, where all users
may make folders: one with its name that belongs to another user, or is a link, is not used, and no other user can read
it.
"""

import os
import platform
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from automos.core.errors import InputError

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def thread_limits(threads: int) -> dict[str, str]:
    """Return the environment under which libraries start no more than `threads` threads in a process."""
    return dict.fromkeys(THREAD_VARIABLES, str(threads))


def cpu_seconds() -> float:
    """Return the processor time of this process and of its ended children."""
    return sum(os.times()[:4])


def peak_megabytes() -> float:
    """Return the most memory this process ever had, 0 if the system does not report it."""
    try:
        import resource
    except ImportError:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def memory_bytes() -> int:
    """Return this machine's memory, 0 if the system does not report it."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 0


def place() -> str:
    """Return which machine this is: Ray's name of it where Ray runs this process, else its own."""
    ray = sys.modules.get("ray")
    if ray is not None and ray.is_initialized():
        return str(ray.get_runtime_context().get_node_id())
    return platform.node()


def default_work() -> Path:
    """Return where it is if the user names no other place."""
    user = str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    return Path(tempfile.gettempdir()) / f"automos-{user}"


def claim(folder: Path) -> None:
    """Make `folder` the user's own where it is in the default place.

    Raises
    ------
    InputError : it belongs to another user.
    """
    if folder == default_work() and hasattr(os, "getuid"):
        os.close(_open_private(folder))


@contextmanager
def work_folder(folder: Path, is_needed: bool = True) -> Iterator[None]:
    """Make `folder`; in the default place it is removed when all is done, unless another process still needs it.

    What an interrupted run has in it stays, for the run that goes on.

    Raises
    ------
    InputError : the default place belongs to another user.
    """
    if not is_needed or folder != default_work() or not hasattr(os, "getuid"):
        yield
        return
    import fcntl

    handle = _open_private(folder)
    try:
        fcntl.flock(handle, fcntl.LOCK_SH)
        yield
        with suppress(BlockingIOError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(handle)


def _open_private(folder: Path) -> int:
    """Return a handle of `folder`, made for this user alone."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError as error:
        raise InputError(f"{folder} cannot be used ({error.strerror}): choose another place with --work") from error
    about = os.fstat(handle)
    if about.st_uid != os.getuid():
        os.close(handle)
        raise InputError(f"{folder} was made by another user: choose another place with --work")
    if stat.S_IMODE(about.st_mode) != 0o700:
        os.fchmod(handle, 0o700)
    return handle
