"""Tables of all formats, for `automos formats`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from automos.readers import FORMATS, load_format
from automos.readers.codecs import CODECS
from automos.writers import EXPORTS, load_export

if TYPE_CHECKING:
    from rich.table import Table


def format_tables() -> Iterator[Table]:
    """Yield the formats of recordings, the kinds of point files, and the formats that results are written in."""
    recordings = _table("recordings that are read", "--format", "what it looks like", "truth", "extra")
    for name in FORMATS:
        format = load_format(name)
        recordings.add_row(name, format.layout, format.truth or "-", _needs(format.needs))
    yield recordings
    files = _table("point files that are read", "--format", "what it is")
    for name, description in CODECS.items():
        files.add_row(name, description)
    yield files
    results = _table("formats that results are written in", "--to", "what it makes", "extra")
    for name in EXPORTS:
        export = load_export(name)
        results.add_row(name, export.writes, _needs(export.needs))
    yield results


def _table(title: str, *headings: str) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    return table


def _needs(extra: str | None) -> str:
    """Return the extra to install for a format."""
    return extra or "-"
