"""Commands called as the shell calls them, and what must not come of one."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout

from automos.cli import main
from automos.core.errors import AutomosError

LAST: list[str] = []
"""What was done to the input that is read now, for a person to read."""


class WrongError(Exception):
    """Something was accepted that should not have been, or refused without a sentence."""


class RefusedError(AutomosError):
    """A command ended with exit code 2 and this sentence."""


def call(*words: object) -> str:
    """Run a command as the shell does; return what it printed.

    Raises
    ------
    RefusedError
        It ended with exit code 2 and a sentence.
    WrongError
        It ended otherwise, or with more or less than one sentence.
    """
    out, err, given = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["automos", *map(str, words)]
    code: object = 0
    try:
        with redirect_stdout(out), redirect_stderr(err):
            main()
    except SystemExit as leaving:
        code = leaving.code or 0
    finally:
        sys.argv = given
    said = err.getvalue()
    if code == 0 or (code == 3 and "not labelled: " in out.getvalue()):
        return out.getvalue()
    if code == 2 and "Usage:" in said:  # typer's own words for values it can tell apart itself
        raise RefusedError("the usage of the command was told")
    if code != 2 or said.count("error: ") != 1:
        raise WrongError(f"exit code {code}, said {said[-500:]!r}")
    raise RefusedError(said[said.index("error: ") + 7 :].strip())
