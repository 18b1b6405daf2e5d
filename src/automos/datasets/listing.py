"""All formats as tables: what `automos formats` shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from automos.datasets import FORMATS, load_format
from automos.datasets.codecs import CODECS

if TYPE_CHECKING:
    from rich.table import Table


def readers() -> Table:
    """Return a row for each format of recordings, then one for each kind of point files."""
    from rich.table import Table

    table = Table(title="Read")
    for heading in ("--format", "what it looks like", "truth", "needs"):
        table.add_column(heading, overflow="fold")
    for name in FORMATS:
        format = load_format(name)
        table.add_row(name, format.layout, format.truth or "-", needs(format.needs))
    table.add_section()
    for name, description in CODECS.items():
        table.add_row(name, f"point files: {description}", "", needs(None))
    return table


def needs(extra: str | None) -> str:
    """Return what to install for a format: the command's last word, or a dash where the core suffices."""
    return "-" if extra is None else f"automos[{extra}]"
