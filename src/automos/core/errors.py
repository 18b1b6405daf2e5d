"""Errors that a user can correct: each message says what is wrong, where, and what to do next.

The command line prints these messages in one line and exits with code 2. Anything else is a bug and keeps its
traceback.
"""


class AutomosError(Exception):
    """Something the user can put right, in one line, whatever names and values it shows."""

    def __str__(self) -> str:
        return " ".join(super().__str__().split("\n"))


class InputError(AutomosError, ValueError):
    """A recording, file or pose that cannot be used as it is."""


class SettingsError(AutomosError, ValueError):
    """A setting that does not exist or is out of range."""


class MissingExtraError(AutomosError, ImportError):
    """An optional package is not installed; the message holds the pip command."""


def plain(text: str) -> str:
    """Return `text` as a terminal may be given it: names of files may hold what moves its cursor or changes colours."""
    return "".join(c if c.isprintable() or c in "\n\t" else "\N{REPLACEMENT CHARACTER}" for c in text)
