"""What kind of road user an object is, by the size of its box: detectors are trained on kinds, motion has none."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

KINDS = ("Vehicle", "Pedestrian", "Cyclist")
_PERSON, _TWO_WHEELER = 1.2, 2.6
"""Metres: the longest side of people walking, and of whoever rides a two-wheeler no wider than a person is long."""


def kinds_of(sizes: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return (K,) index into `KINDS` of boxes with `sizes` (K, 3): length, width, height in metres."""
    longest, shortest = sizes[:, :2].max(1), sizes[:, :2].min(1)
    return np.select([longest < _PERSON, (longest < _TWO_WHEELER) & (shortest < _PERSON)], [1, 2], 0)
