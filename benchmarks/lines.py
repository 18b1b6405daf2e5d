"""A table of text, shown on the screen and stored as `all.py` writes it into the docs."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console
from rich.table import Table


def show_lines(lines: list[list[str]], path: Path | None, title: str | None = None) -> None:
    """Print `lines`, the heading first, and store them in `path`, if there is one, as JSON."""
    shown = Table(*lines[0], title=title)
    for line in lines[1:]:
        shown.add_row(*line)
    Console(width=150).print(shown)
    if path:
        path.write_text(json.dumps(lines, indent=1))
