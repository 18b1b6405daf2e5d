"""The declaration of a writer: what it writes, and how."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from automos.core.claims import SIGN
from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles


@dataclass(frozen=True)
class Export:
    """A format that results are written in: the constant `EXPORT` of each module that writes one.

    Attributes
    ----------
    writes : what it makes, in one line.
    write : takes a run and the folder (or file) to write; what is there already is replaced.
    needs : the extra to install, None where the core suffices.
    modules : what it imports of that extra; looked for before anything is made.
    suffix : of the one file it writes; empty where it writes a folder.
    sign : what that file has in it, by which it is known to be ours.
    is_of_points : whether it holds the recording's points as they are, so that they can be asked for deskewed.
    per_scan : patterns of the files, named after the scans, that readers of the folder take; those of other scans are
        not mixed with them.
    name_of : returns what the results of a recording are called, of its name; no two may be called the same.
    """

    writes: str
    write: Callable[[RunFiles, Path], None]
    needs: str | None = None
    modules: tuple[str, ...] = ()
    suffix: str = ""
    sign: bytes = SIGN
    is_of_points: bool = False
    per_scan: tuple[str, ...] = ()
    name_of: Callable[[str], str] = str

    def require(self) -> None:
        """Raise MissingExtraError where what it imports is not installed."""
        for module in self.modules:
            import_extra(module, str(self.needs))


def make_folders(out: Path, *names: str) -> None:
    """Make folders below `out` where they are not there."""
    for name in names:
        (out / name).mkdir(parents=True, exist_ok=True)
