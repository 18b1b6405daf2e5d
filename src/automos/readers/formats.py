"""What a reader declares of itself, how it finds recordings and gets the optional package it may need."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from automos.core.errors import MissingExtraError
from automos.core.extras import pip_install
from automos.core.scan import Sequence


@dataclass(frozen=True)
class Format:
    """A format of recordings: the constant `FORMAT` of each module that reads one.

    Attributes
    ----------
    layout : what its recordings look like on disk, in one line; up to a colon or semicolon, what they are.
    truth : where labels to compare with come from; empty where it has none.
    find : returns the recordings of this format at a path, none where it is of another. Needs no optional package.
    open : returns one of them; takes the path and, where `has_codecs`, the codec the user asked for or None.
    needs : the extra to install, None where the core suffices.
    has_codecs : whether its scans are point files of any of the kinds in `codecs`.
    """

    layout: str
    truth: str
    find: Callable[[Path], list[Path]]
    open: Callable[..., Sequence]
    needs: str | None = None
    has_codecs: bool = False


def recordings_at(path: Path, is_recording: Callable[[Path], bool]) -> list[Path]:
    """Return `path` if it is a recording, else those that lie in it, by name."""
    if is_recording(path):
        return [path]
    return sorted(filter(is_recording, path.iterdir())) if path.is_dir() else []


def import_extra(module: str, extra: str) -> Any:
    """Return the imported `module`, which comes with the optional dependencies `extra`.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise MissingExtraError(f"{package} is not installed; run: {pip_install(extra)}") from None
