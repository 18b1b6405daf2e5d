"""Calls one function for many scans on all cores, with results in order.

Processes are used where a library holds the interpreter's lock (HDBSCAN). They are joblib's loky processes, which do
not import the caller's script again, so a script needs no `if __name__ == "__main__"`. Threads are used where our own
kernels release the lock. Order and results do not depend on the number of workers.
"""

import ctypes
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import islice
from numbers import Integral
from threading import Event, Lock, Thread
from typing import TypeVar

from automos.core.errors import InputError

SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""Environment under which a Python process does not look for modules in its working folder."""

MOST_WORKERS = 4096
"""On one machine; more is a slip of the keyboard."""
_LOOK = 0.5
"""Seconds between looks whether the parent is still there."""
Item = TypeVar("Item")
Result = TypeVar("Result")


def available_cores() -> int:
    """Return how many cores this process may use (its affinity, not the machine's size)."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def return_memory() -> None:
    """Give the system what this process has freed: a stage leaves gaps between what it kept, too small for the next.

    glibc alone gives back what lies above everything that is in use. Elsewhere nothing happens.
    """
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def checked_workers(workers: object, what: str = "workers") -> int:
    """Return how many workers, or `what` they are called, are asked for.

    Raises
    ------
    InputError : `workers` is not a number of them.
    """
    if not isinstance(workers, Integral) or not 0 <= int(workers) <= MOST_WORKERS:
        raise InputError(
            f"{what} are 0, one per core, or how many there are to be, not {workers!r} ({MOST_WORKERS} at most)"
        )
    return int(workers)


def map_in_order(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    workers: int,
    threads: bool = False,
    chunk: int = 16,
) -> Iterator[Result]:
    """Yield function(item) for each of `items`, in order, computed by `workers` processes (0: one per core).

    `function` and `items` must be picklable, unless `threads` are asked for instead of processes. At most `chunk` items
    per worker are taken ahead, so memory does not grow with their number.
    """
    workers = workers or available_cores()
    if workers == 1:
        yield from map(function, items)
        return
    items = iter(items)
    if threads:
        yield from _in_threads(function, items, workers)
        return
    from joblib import Parallel, delayed, parallel_config

    # max_nbytes: scans go through pipes; joblib would write those over a megabyte to temporary files.
    ending = {"initializer": end_with, "initargs": (os.getpid(),)}
    loky = parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1, **ending)
    with starting_processes(), loky, Parallel(max_nbytes=None) as pool:
        while ahead := list(islice(items, chunk * workers)):
            yield from pool(delayed(function)(item) for item in ahead)


def map_in_shares(
    pool: ThreadPoolExecutor, function: Callable[[Item], Result], items: Iterable[Item], shares: int = 4
) -> list[Result]:
    """Return function(item) for each of `items`, in order, in a few tasks of `pool`: one for each takes longer.

    So do tasks for the few items of a scan in a stream: each waits for the interpreter's lock.
    """
    items = list(items)
    if len(items) < 2 * shares:
        return list(map(function, items))
    parts = [items[k * len(items) // shares : (k + 1) * len(items) // shares] for k in range(shares)]
    return [found for part in pool.map(lambda part: list(map(function, part)), parts) for found in part]


@contextmanager
def starting_processes() -> Iterator[None]:
    """Let no Python process that is started until the block ends look for modules in the working folder."""
    before = {name: os.environ.get(name) for name in SAFE_PATH}
    os.environ.update(SAFE_PATH)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def end_with(parent: int) -> None:
    """End this process soon after process `parent`, which started it, however that ends."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(1)

    if os.name == "posix":  # elsewhere the number of the parent stays
        Thread(target=watch, daemon=True).start()


def _in_threads(function: Callable[[Item], Result], items: Iterator[Item], workers: int) -> Iterator[Result]:
    with ThreadPoolExecutor(workers) as pool:
        waiting = deque(pool.submit(function, item) for item in islice(items, 2 * workers))
        while waiting:
            yield waiting.popleft().result()
            waiting.extend(pool.submit(function, item) for item in islice(items, 1))


def one_ahead(
    function: Callable[[Item], Result], items: Iterable[Item], ends: Callable[[Result], bool]
) -> Iterator[Result]:
    """Yield function(item) for each of `items`, in order, computed in a thread while the caller uses the one before.

    After a result that `ends` something the next is not begun before the caller comes back. When the caller stops, a
    call of `function` is waited for, but not `items`: they may never bring another.
    """
    items, is_over, working = iter(items), Event(), Lock()

    def compute() -> list[Result]:
        found = list(islice(items, 1))
        with working:
            return [] if is_over.is_set() else [function(item) for item in found]

    thread = ThreadPoolExecutor(1)
    try:
        found = thread.submit(compute).result()
        while found:
            following = None if ends(found[0]) else thread.submit(compute)
            yield found[0]
            found = (following or thread.submit(compute)).result()
    finally:
        with working:
            is_over.set()
        thread.shutdown(wait=False, cancel_futures=True)
