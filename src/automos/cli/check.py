"""The command `check`: what a recording is, and whether it can be labelled."""

import json
from contextlib import suppress
from typing import Annotated

import typer

from automos.cli.consoles import output
from automos.cli.options import Format, Recording

check_app = typer.Typer()


@check_app.command()
def check(
    recording: Recording,
    format: Format = None,
    as_json: Annotated[bool, typer.Option("--json", help="print all that was found as JSON")] = False,
) -> None:
    """Say what a recording is, what will be assumed of it, and whether it can be labelled; make no labels.

    It reads headers and at most 20 scans. The exit code is 0, 1 where there are doubts, 2 where it cannot be labelled.

    [bold]Examples[/bold]

    automos check my_log/

    automos check my_log/ --columns x,y,z,intensity,ring,time

    automos check drive.bag --json
    """
    from automos.core.errors import AutomosError, plain
    from automos.fleet.sources import find_all
    from automos.views.checking import check as check_recordings

    found = check_recordings(recording, format)
    with suppress(AutomosError):  # found has it
        if found[0].error and len(several := find_all(str(recording), format)) > 1:  # as `label` takes them
            found = [each for one in several for each in check_recordings(one.source, one.format)]
    if as_json:
        output.print(json.dumps([one.to_dict() for one in found], indent=1), markup=False, soft_wrap=True)
    else:
        for one in found:
            output.print(plain("\n".join(one.lines())), markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(max(one.exit_code for one in found))
