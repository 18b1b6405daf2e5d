"""Checks of paths and objects that callers pass: InputError with a sentence if they are something else."""

import errno
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from automos.core.errors import InputError


def given_path(value: str | os.PathLike[str], what: str) -> Path:
    """Return `value` as a path; InputError if no file or folder can be named so, which `what` calls it."""
    try:
        path = Path(value)
        path.lstat()
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is not a path ({error}): give a text or a pathlib.Path, not {value!r:.80}") from None
    except OSError as error:  # what is not there yet may be made
        if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
            raise InputError(f"{what} {value!s:.80} cannot be used ({error.strerror}): give another path") from None
    return path


def require_kind(value: object, kind: Any, what: str, remedy: str) -> None:
    """Raise InputError if `value` is not of `kind`, a class; `remedy` says what to give as `what`."""
    if not isinstance(value, kind):
        raise InputError(f"{what} is {value!r:.80}, of type {type(value).__name__}: give {remedy}")


def require_own_names(names: Sequence[str]) -> None:
    """Raise InputError if two of several recordings, whose results are found by their `names`, have the same."""
    twice = next((name for name, times in Counter(names).items() if times > 1), None)
    if twice is not None:
        raise InputError(f"two recordings are named {twice}, and results go by that: rename one, or give each alone")
