"""Protection against files in the working folder, which may come from any source: none of them is executed.

Python searches modules in the working folder first when it is started with `-m` or `-c`, as worker processes are. numba
and Matplotlib read settings from it, and numba's can name a folder of compiled code to load. This module prevents all
of that.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

OURS = {"AUTOMOS_COMMAND": "1"}
"""Environment of processes that the command line runs in: they are ours to end."""

_SETTINGS = {".numba_config.yaml": "numba", "matplotlibrc": "matplotlib"}


@contextmanager
def standing_elsewhere() -> Iterator[None]:
    """Stand in the package's own folder until the block ends."""
    here = os.open(".", os.O_RDONLY) if hasattr(os, "fchdir") else os.getcwd()
    os.chdir(Path(__file__).parents[1])
    try:
        yield
    finally:
        os.chdir(here)
        if isinstance(here, int):
            os.close(here)


def ignore_settings_here() -> None:
    """Import the libraries whose settings lie in the working folder while standing elsewhere."""
    for file, library in _SETTINGS.items():
        if not os.path.lexists(file):
            continue
        with standing_elsewhere():
            import_module(library)
        if library == "numba":  # which would look again whenever it compiles
            config: Any = import_module("numba.core.config")
            config._config_fname = ""
