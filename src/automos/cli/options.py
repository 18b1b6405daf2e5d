"""What commands share: arguments and options, each with one name and one help text, and the consoles.

Results go to standard output, messages about them to standard error.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from automos.core.errors import InputError, plain

if TYPE_CHECKING:
    from automos.core.progress import StageProgress
    from automos.settings import Settings


class PlainConsole(Console):
    """A console that is given names from anywhere: no text in them is taken for an order to the terminal."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does."""
        super().print(*(plain(str(each)) if isinstance(each, str | Path) else each for each in objects), **options)


app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Automatic moving/static labels for every point of a LiDAR recording.",
)
console = PlainConsole(stderr=True)
output = PlainConsole(highlight=False, markup=False, soft_wrap=True)


class _Teller(logging.Handler):
    """Prints the library's warnings as sentences as they come, each once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.shown: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        sentence = record.getMessage()
        if record.levelno == logging.WARNING and sentence not in self.shown:
            self.shown.add(sentence)
            console.print(f"warning: {sentence}", markup=False, soft_wrap=True)


_handler = _Teller()


def set_up_logging(debug: bool) -> None:
    """Show the library's warnings as sentences; with `debug`, all messages of all libraries as they are."""
    screen = logging.StreamHandler()
    screen.setLevel(logging.DEBUG if debug else logging.ERROR)
    logging.basicConfig(
        level=logging.DEBUG if debug else logging.WARNING, format="%(name)s: %(message)s", handlers=[screen]
    )
    logging.captureWarnings(True)  # NumPy's and others' of odd numbers: ours are sentences
    _handler.shown.clear()
    log = logging.getLogger("automos")
    (log.removeHandler if debug else log.addHandler)(_handler)


Recording = Annotated[Path, typer.Argument(help="a folder of scans, a data set, a bag: see automos formats")]
Recordings = Annotated[
    str, typer.Argument(help="a recording (see automos formats), a folder of them, a list (.txt), or a URL")
]
Results = Annotated[Path, typer.Argument(help="a results folder of automos label")]
Moved = Annotated[
    Path | None, typer.Argument(help="the recording, if it is no longer where it was when it was labelled")
]
Format = Annotated[
    str | None,
    typer.Option(
        "--format",
        "--columns",
        help="the recording's format, or the columns of files without names: x,y,z,intensity,ring,time",
    ),
]
Preset = Annotated[str, typer.Option(help="paper: as in the paper; default: the best labels")]
SettingsFile = Annotated[Path | None, typer.Option("--settings", help="YAML file of settings that differ")]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", help="one setting, e.g. tracking.max_misses=3; repeatable")
]
Rate = Annotated[float | None, typer.Option(min=0.1, max=1000, help="scans a second, if none has a time; assumed: 10")]
Poses = Annotated[Path | None, typer.Option(help="poses to use instead of odometry: KITTI or TUM file")]
Calib = Annotated[Path | None, typer.Option(help="calib.txt with Tr:, if the poses are the camera's")]
Workers = Annotated[int, typer.Option(min=0, help="processes; 0: one per core")]


def read_settings(
    file: Path | None, overrides: list[str] | None, given: Mapping[str, Any] | None = None, preset: str = "default"
) -> Settings:
    """Return a preset, changed by a file, then by `given`, options that are settings or None, then by overrides."""
    from automos.settings import load_settings, read_overrides

    options = {name: value for name, value in (given or {}).items() if value is not None}
    return load_settings(preset, file, {**options, **read_overrides(overrides)})


def progress_of(title: str, counted: str = "scans") -> StageProgress:
    """Return the progress of stages under `title`, on standard error; what draws it is imported when it is needed."""
    from automos.core.progress import StageProgress

    return StageProgress(console, title, counted)


def pair(given: list[str] | None, option: str, usage: str, key: int = 0) -> dict[str, str]:
    """Return texts like NAME=VALUE as a dictionary; `key` says which half is one thing's alone: 0, or 1 the second."""
    found: dict[str, str] = {}
    for text in given or []:
        halves = text.split("=", 1)
        if len(halves) < 2 or not all(halves) or halves[key] in found:
            raise InputError(f"{option} {text}: {usage}, each {('name', 'recording')[key]} once")
        found[halves[key]] = halves[1 - key]
    return found


def _require_finite(lag: float) -> float:
    if not 0.0 <= lag < float("inf"):
        raise InputError(f"--lag is {lag:g}: give 0 or some seconds")
    return lag


Lag = Annotated[
    float, typer.Option(callback=_require_finite, help="seconds by which labels may come later than their scan")
]


def on_this_machine(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return `command`, wrapped so that it refuses a URL where a local path is needed.

    A path drops the second slash of s3://bucket/x: results would go into a folder called "s3:". Arguments that may be
    URLs are strings.
    """

    @wraps(command)
    def checked(**given: Any) -> Any:
        values = [one for value in given.values() for one in (value if isinstance(value, list) else [value])]
        for path in (value for value in values if isinstance(value, Path)):
            address = re.match(r"([A-Za-z][A-Za-z0-9+.-]+:)[/\\]+(.*)", str(path), re.DOTALL)
            if address:
                raise InputError(
                    f"{address[1]}//{address[2]} is an address, and a path on this machine is needed here; "
                    "automos label takes addresses as RECORDING and --out"
                )
        return command(**given)

    return checked
