"""Where commands print: results to standard output, everything said about them to standard error."""

from __future__ import annotations

from rich.console import Console

console = Console(stderr=True)
output = Console(highlight=False, markup=False, soft_wrap=True)
