"""BLAS in one thread: our products are small, and a library's threads that wait for such take the cores from ours."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from threading import Lock
from typing import Any

_lock, _limit = Lock(), ExitStack()
_n_inside = 0


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread in this process, until the last of those who are in such a block leaves it."""
    global _n_inside
    with _lock:
        _n_inside += 1
        if _n_inside == 1:
            _limit.enter_context(_libraries().limit(limits=1, user_api="blas"))
    try:
        yield
    finally:
        with _lock:
            _n_inside -= 1
            if _n_inside == 0:
                _limit.close()


@cache
def _libraries() -> Any:
    import scipy.linalg  # noqa: F401  # it brings a BLAS of its own, besides NumPy's
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
