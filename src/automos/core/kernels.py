"""How the loops are compiled that NumPy would take too long for: `@kernel`, by numba.

Kernels release the interpreter's lock, and are kept on disk where a folder for them can be written. None is called from
C, so that none gets an entry for it: a quarter of what a small kernel takes to compile.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numba


def kernel(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Return `function`, to be compiled by numba with `options` when it is called; without it, what does that."""
    if function is None:
        return partial(kernel, **options)
    options = {"nogil": True, "no_cfunc_wrapper": True, **options}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # neither beside the source nor in the user's home
        return numba.njit(**options)(function)
