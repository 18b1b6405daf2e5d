"""How the loops are compiled that NumPy would take too long for: `@kernel`, by numba.

Kernels release the interpreter's lock, and are kept on disk. None is called from C, so that none gets an entry for it:
a quarter of what a small kernel takes to compile.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numba

kernel: Any = partial(numba.njit, cache=True, nogil=True, no_cfunc_wrapper=True)
