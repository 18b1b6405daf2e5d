"""The results of stages: named groups of arrays, for each scan or for the recording as a whole, kept in memory.

Each is found by the fingerprint of what it was made from, so that results of other settings are never taken for it.
`core/workspace.py` keeps the same in files.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Mapping

import numpy.typing as npt

from automos.core.errors import InputError

Arrays = Mapping[str, npt.NDArray]
PerScan = Iterable[tuple[int, Arrays]]


def fingerprint(*parts: object) -> str:
    """Return 16 hexadecimal digits that change when any of `parts` (anything JSON can write, or str) does."""
    text = json.dumps(parts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Stage:
    """Results of one stage for one recording and one set of settings: named groups of arrays."""

    def __init__(self) -> None:
        self._groups: dict[str, dict[str, npt.NDArray]] = {}

    def has(self, name: str) -> bool:
        """Return whether `name` was saved."""
        return name in self._groups

    def save(self, name: str, arrays: Arrays) -> None:
        """Keep `arrays` under `name`."""
        self._groups[name] = dict(arrays)

    def load(self, name: str, *keys: str) -> dict[str, npt.NDArray]:
        """Return the arrays saved under `name`: those named by `keys`, all where none is named."""
        group = self._groups[name]
        return {key: group[key] for key in keys or group}


class Stages:
    """The results of all stages of a run."""

    def __init__(self) -> None:
        self._stages: dict[str, Stage] = {}

    def require_names(self, names: list[str], n_scans: int) -> None:
        """Raise InputError if results of `n_scans` scans cannot be kept under `names`."""
        are_texts = isinstance(names, list) and all(isinstance(name, str) for name in names)
        if not are_texts or len(names) != n_scans:
            raise InputError(f"the names of {n_scans} scans are {names!r:.80}: give a list with a text for each scan")
        twice = next((name for name, times in Counter(names).items() if times > 1), None)
        if twice is not None:
            raise InputError(f"two scans are named {twice!a:.80}: give each scan a name of its own")

    def stage(self, name: str, key: str) -> Stage:
        """Return the stage `name` as made under fingerprint `key`."""
        return self._stages.setdefault(f"{name}-{key}", Stage())

    def keep_only(self, keys: Mapping[str, str]) -> None:
        """Remove stages made under other fingerprints than `keys` (stage name: fingerprint)."""
        wanted = {f"{name}-{key}" for name, key in keys.items()}
        self._stages = {name: stage for name, stage in self._stages.items() if name in wanted}
