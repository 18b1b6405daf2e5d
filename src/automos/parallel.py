"""The same function over many scans, on all cores, results in order.

Worker processes, because HDBSCAN holds the interpreter's lock; joblib's loky starts them, because it does not import the
caller's script again (a user's script needs no `if __name__ == "__main__"`). Order and results do not depend on how many
there are.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def available_cores() -> int:
    """Return how many cores this process may use (its affinity, not the machine's size)."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def map_in_order(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int, chunk: int = 32
) -> Iterator[Result]:
    """Yield function(item) for each of `items`, in order, computed by `workers` processes (0: one per core).

    `function` and `items` must be picklable. At most `chunk` results per worker wait to be taken, so memory does not
    grow with the number of items.
    """
    workers = min(workers or available_cores(), len(items))
    if workers <= 1:
        yield from map(function, items)
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1), Parallel() as pool:
        step = chunk * workers
        for first in range(0, len(items), step):
            yield from pool(delayed(function)(item) for item in items[first : first + step])
