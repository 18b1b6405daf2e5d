"""The commands about what comes in and what goes out: parse, call one function, print."""

from __future__ import annotations

import typer
from rich.console import Console

formats_app = typer.Typer()
output = Console(highlight=False, markup=False, soft_wrap=True)


@formats_app.command()
def formats() -> None:
    """List the formats that can be read and written, and what each needs."""
    from automos.datasets.listing import readers

    output.print(readers())
