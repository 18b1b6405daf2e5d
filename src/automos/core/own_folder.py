"""Folders of many files that we make of what is described: an interrupted command goes on in its own.

Beside the mark by which a folder is known to be ours, a JSON file in it says of what it is made. It is there before
anything else and says "unfinished" until all of it is written, so that a reader sees what is half.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from automos.core.atomic import faults_reported, held, remove_parts, write_text
from automos.core.claims import claim
from automos.core.errors import InputError
from automos.core.reading import read_json

UNFINISHED = "unfinished"
"""Entry of that file until all of its folder is written."""


@contextmanager
def own_folder(folder: Path, holds: str, marker: str, about: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Hold `folder` while what `about` describes is written into it; what was written of the same before is kept.

    Parameters
    ----------
    holds : one of the kinds in `claims`.
    marker : name of the JSON file.
    about : what is written, of which recordings, with which options.

    Yields
    ------
    dict
        To be filled with what the file says beside `about` once all is written.

    Raises
    ------
    InputError
        The folder holds other things, another process writes into it, or it cannot be written.
    """
    claim(folder, holds)
    with held(folder):
        if (folder / marker).exists():
            _require_same(folder, marker, json.loads(json.dumps(about)))
        with faults_reported(folder):
            write_text(folder / marker, json.dumps({**about, UNFINISHED: True}, indent=2) + "\n")
            remove_parts(folder)
        found: dict[str, Any] = {}
        yield found
        write_text(folder / marker, json.dumps({**about, **found}, indent=2) + "\n")


def _require_same(folder: Path, marker: str, wanted: dict[str, Any]) -> None:
    """Raise InputError where `folder` was made of something else than what is `wanted` now."""
    try:
        before = read_json(folder / marker)
    except ValueError:
        before = None
    if not isinstance(before, dict):
        raise InputError(f"{folder / marker} is damaged: choose a new folder, or remove it")
    differs = next((key for key in wanted if before.get(key) != wanted[key]), None)
    if differs is not None:
        was, now = (json.dumps(value.get(differs)) for value in (before, wanted))
        raise InputError(
            f"{folder} was written of something else ({differs}: {was:.200}, not {now:.200}): choose a new folder, or "
            "remove it"
        )
