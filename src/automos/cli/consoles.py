"""Where commands print: results to standard output, everything said about them to standard error."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from automos.errors import plain


class PlainConsole(Console):
    """A console that is given names from anywhere: no text in them is taken for an order to the terminal."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does."""
        super().print(*(plain(each) if isinstance(each, str) else each for each in objects), **options)


console = PlainConsole(stderr=True)
output = PlainConsole(highlight=False, markup=False, soft_wrap=True)
