"""Folders of many files that we make: known by a marker, a JSON file in them that says what they are of.

The marker is there before anything else is and says "unfinished" until everything is, so that an interrupted command
goes on in its own folder, another one does not, and a reader sees what is half.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from automos.core.atomic import faults_reported, held, remove_parts, write_text
from automos.core.errors import InputError
from automos.core.reading import read_json

UNFINISHED = "unfinished"
"""Entry of a marker until all of its folder is written."""


@contextmanager
def own_folder(folder: Path, marker: str, about: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Hold `folder` while what `about` describes is written into it; what was written of the same before is kept.

    Parameters
    ----------
    folder : is made, or is empty, or holds what an earlier call with the same `about` left.
    marker : name of the JSON file that says so.
    about : what is written, of which recordings, with which options.

    Yields
    ------
    dict
        To be filled with what the marker says beside `about` once all is written.

    Raises
    ------
    InputError
        The folder holds other things, another process writes into it, or it cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: choose a folder to write to")
    with held(folder):
        if any(folder.iterdir()):
            _require_same(folder, marker, about)
        with faults_reported(folder):
            write_text(folder / marker, json.dumps({**about, UNFINISHED: True}, indent=2) + "\n")
            for place in (folder, *(path for path in folder.rglob("*") if path.is_dir())):
                remove_parts(place)
        found: dict[str, Any] = {}
        yield found
        write_text(folder / marker, json.dumps({**about, **found}, indent=2) + "\n")


def _require_same(folder: Path, marker: str, about: Mapping[str, Any]) -> None:
    """Raise InputError where `folder` was not written by the command that would write it now."""
    try:
        before = read_json(folder / marker)
    except (OSError, ValueError):
        before = None
    if not isinstance(before, dict):
        raise InputError(f"{folder} exists and holds other things (no {marker} of ours): choose a new folder")
    wanted = json.loads(json.dumps(about))
    differs = next((key for key in wanted if before.get(key) != wanted[key]), None)
    if differs is not None:
        was, now = (json.dumps(value.get(differs)) for value in (before, wanted))
        raise InputError(
            f"{folder} was written of something else ({differs}: {was:.200}, not {now:.200}): choose a new folder, or "
            "remove it"
        )
