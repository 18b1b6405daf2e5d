"""What a job of `all.py` is."""

from __future__ import annotations

import shlex
from dataclasses import dataclass


@dataclass(frozen=True)
class Job:
    """One script with fixed arguments; `DRIVE_0005`, `STORE`, `CACHE` and `DOCS` in them are replaced.

    Attributes
    ----------
    name, script, arguments : the whole of it.
    quick : arguments of a short form, which `--quick` runs instead.
    rooms : the parts of the package that its result is of, all that shape labels where none are named.
    also : parts that shape no labels, but its result.
    needs_recordings : whether it is about the real recordings in the folder that AUTOMOS_RECORDINGS names.
    is_timed : whether its result has seconds or memory, so that nothing else may run beside it.
    """

    name: str
    script: str
    arguments: tuple[str, ...]
    quick: tuple[str, ...]
    rooms: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    needs_recordings: bool = False
    is_timed: bool = False

    @property
    def needs_drive(self) -> bool:
        return any("DRIVE_0005" in word for word in self.arguments)

    def command(self, is_quick: bool) -> str:
        return f"python benchmarks/{self.script} {shlex.join(self.quick if is_quick else self.arguments)}"
