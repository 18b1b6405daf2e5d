"""Moving points found by a published method, in place of free-space evidence.

Methods are handed in by packages that name them in the entry point group `automos.evidence`, as this one names its own
(ERASOR, which is the paper's, among them): a mapping of names to objects with `find_moving` and `key`.
"""

from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import entry_points
from typing import Protocol

import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import Frames, Mask
from automos.settings import Settings

FindMoving = Callable[[Frames, npt.NDArray, Settings, int], Iterator[tuple[int, Mask]]]
"""Takes frames, their times (N,) in s, all settings and the first index wanted; yields (index, (M,) bool moving)."""


class Published(Protocol):
    """A published method that finds moving points."""

    @property
    def find_moving(self) -> FindMoving:
        """Yield which points of each frame move."""

    @property
    def key(self) -> str:
        """All parameters as a text, which is part of the fingerprint of results."""


def handed_in(name: str) -> Published:
    """Return the method that an installed package calls `name`.

    Raises
    ------
    InputError
        No installed package has one.
    """
    for package in entry_points(group="automos.evidence"):
        methods: Mapping[str, Published] = package.load()
        if name in methods:
            return methods[name]
    raise InputError(f"no installed package hands in the method {name}: install AutoMOS again (pip install .)")
