"""Checks of objects that callers pass: InputError with a sentence if they are something else."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

from automos.core.errors import InputError


def require_kind(value: object, kind: Any, what: str, remedy: str) -> None:
    """Raise InputError if `value` is not of `kind`, a class; `remedy` says what to give as `what`."""
    if not isinstance(value, kind):
        raise InputError(f"{what} is {value!r:.80}, of type {type(value).__name__}: give {remedy}")


def require_own_names(names: Sequence[str]) -> None:
    """Raise InputError if two of several recordings, whose results are found by their `names`, have the same."""
    twice = next((name for name, times in Counter(names).items() if times > 1), None)
    if twice is not None:
        raise InputError(f"two recordings are named {twice}, and results go by that: rename one, or give each alone")
