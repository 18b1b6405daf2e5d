"""Where commands print: results to standard output, everything said about them to standard error."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from rich.console import Console

from automos.errors import plain


class PlainConsole(Console):
    """A console that is given names from anywhere: no text in them is taken for an order to the terminal."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does."""
        super().print(*(plain(str(each)) if isinstance(each, str | Path) else each for each in objects), **options)


console = PlainConsole(stderr=True)
output = PlainConsole(highlight=False, markup=False, soft_wrap=True)


class _Teller(logging.Handler):
    """Prints the library's warnings as sentences as they come, each once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.told: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        sentence = record.getMessage()
        if record.levelno == logging.WARNING and sentence not in self.told:
            self.told.add(sentence)
            console.print(f"warning: {sentence}", markup=False, soft_wrap=True)


_teller = _Teller()


def set_up_logging(debug: bool) -> None:
    """Have the library's warnings told as sentences; with `debug` every message of everybody is written as it is."""
    screen = logging.StreamHandler()
    screen.setLevel(logging.DEBUG if debug else logging.ERROR)
    logging.basicConfig(
        level=logging.DEBUG if debug else logging.WARNING, format="%(name)s: %(message)s", handlers=[screen]
    )
    logging.captureWarnings(True)  # NumPy's and others' of odd numbers: ours are sentences
    _teller.told.clear()
    log = logging.getLogger("automos")
    (log.removeHandler if debug else log.addHandler)(_teller)
