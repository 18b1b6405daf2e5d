"""The command line: one module per group of commands. A command parses, calls one function and prints."""

import io
import os
import re
import signal
import sys
from contextlib import suppress
from typing import Annotated, NoReturn

import typer
from rich.text import Text

from automos.cli import label, score, formats, look, compare, network, live, worlds  # isort: skip  # as help lists them
from automos.cli.memory import require_memory, share_heap
from automos.cli.options import app, console, on_this_machine, output, set_up_logging
from automos.core.atomic import is_full
from automos.core.errors import AutomosError, plain
from automos.core.parallel import SAFE_PATH
from automos.core.working_folder import OURS

for command in app.registered_commands:
    command.callback = command.callback and on_this_machine(command.callback)


def _print_version(wanted: bool) -> None:
    if wanted:
        from automos import __version__

        output.print(__version__)
        raise typer.Exit


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option(help="show tracebacks and log messages")] = False,
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="print the version")
    ] = False,
) -> None:
    set_up_logging(debug)
    _Debug.on = debug


class _Debug:
    on = False


LONGEST = 2000
"""Characters of an error that are shown, half of them from its end: a file may name a million columns."""
LONGEST_WORD = 500
"""Of them, of a name: what is wrong with it stands beside it."""


def _tell(sentence: str) -> NoReturn:
    """Print what went wrong, without the control characters that names of files may hold, and leave with code 2."""
    words = " ".join(_shortened(word, LONGEST_WORD) for word in sentence.replace("\n", " ").split(" "))
    with suppress(OSError):  # standard error is full, too: the message is lost
        console.print(Text.assemble(("error: ", "red"), plain(_shortened(words, LONGEST))), soft_wrap=True)
    sys.exit(2)


def _shortened(text: str, longest: int) -> str:
    """Return `text`, only its beginning and its end if it has more than `longest` characters."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"


def _refused(error: Exception) -> str:
    """Return what is wrong, or what the system refused, as a sentence."""
    if isinstance(error, AutomosError):
        return str(error)
    if isinstance(error, OSError):
        where = error.filename if error.filename is not None else "the system"
        remedy = "free some space" if is_full(error) else "check its name, its place and who may use it"
        return f"{where}: {error.strerror or error}; {remedy}"
    if isinstance(error, MemoryError):
        return "there is not enough memory for this: give smaller recordings, fewer --workers or a larger machine"
    return f"a name or text cannot be used ({error}); see the place with automos --debug"


def _require_streams() -> None:
    """Open to nowhere what we were started without: a file of results would get its number, and others' words.

    And have those that are there take names of any letters.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)
            os.set_inheritable(nowhere, True)  # our worker processes need them, too
            setattr(sys, name, os.fdopen(nowhere, mode))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal of few letters is no reason to lose a name


def main() -> None:
    """Run the command line; a user's mistake is one sentence and exit code 2."""
    _require_streams()
    require_memory(_tell)
    share_heap()
    if any(not word or re.fullmatch("--[a-z-]+=", word) for word in sys.argv[1:]):  # and not the working folder
        _tell("a word of the command is empty, as where a variable of the shell is not set: give a name or a value")
    os.environ.update(SAFE_PATH | OURS)  # for every process that is started from here, by whatever library
    try:
        app(prog_name="automos")
    except (AutomosError, OSError, MemoryError, UnicodeError, RecursionError) as error:
        if _Debug.on:
            raise
        _tell(_refused(error))
    except (KeyboardInterrupt, SystemExit) as leaving:
        code = 130 if isinstance(leaving, KeyboardInterrupt) else leaving.code  # what typer makes of it, once it runs
        if code == 130:
            signal.signal(signal.SIGINT, lambda *_: None)  # who presses it twice gets no traceback
            console.print("interrupted; the same command goes on from here", soft_wrap=True)
        sys.exit(code)
