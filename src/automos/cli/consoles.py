"""Consoles: results go to standard output, messages about them to standard error."""

import logging
from pathlib import Path
from typing import Any

from rich.console import Console

from automos.core.errors import plain


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
        self.shown: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        sentence = record.getMessage()
        if record.levelno == logging.WARNING and sentence not in self.shown:
            self.shown.add(sentence)
            console.print(f"warning: {sentence}", markup=False, soft_wrap=True)


_handler = _Teller()


def set_up_logging(debug: bool) -> None:
    """Show the library's warnings as sentences; with `debug`, all messages of all libraries as they are."""
    screen = logging.StreamHandler()
    screen.setLevel(logging.DEBUG if debug else logging.ERROR)
    logging.basicConfig(
        level=logging.DEBUG if debug else logging.WARNING, format="%(name)s: %(message)s", handlers=[screen]
    )
    logging.captureWarnings(True)  # NumPy's and others' of odd numbers: ours are sentences
    _handler.shown.clear()
    log = logging.getLogger("automos")
    (log.removeHandler if debug else log.addHandler)(_handler)
