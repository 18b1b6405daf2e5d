"""Recordings that show a part of another one: some of its scans, or of their points."""

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.scan import Mask, Scan, Sequence


class View(Sequence):
    """The scans `ids` of `sequence`, all by default; subclasses choose among their points."""

    def __init__(self, sequence: Sequence, ids: npt.NDArray[np.intp] | None = None):
        self._sequence, self._ids = sequence, np.arange(len(sequence)) if ids is None else ids
        self.name, self.source = sequence.name, sequence.source

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> Scan:
        return self._sequence[int(self._ids[index])]

    @property
    def names(self) -> list[str]:
        """Names of these scans."""
        names = self._sequence.names
        return [names[i] for i in self._ids]

    @property
    def stamps(self) -> Array | None:
        """(len,) seconds of these scans, or None."""
        stamps = self._sequence.stamps
        return None if stamps is None else stamps[self._ids]

    @property
    def is_compensated(self) -> bool | None:
        """As in the full recording."""
        return self._sequence.is_compensated


def distinct_scans(sequence: Sequence, is_repeat: Mask) -> View:
    """Return the recording without its scans that repeat the one before, (N,) `is_repeat`."""
    return View(sequence, np.flatnonzero(~is_repeat))
