"""What kind of road user an object is, by the size of its boxes: readers of boxes ask for it, motion does not say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from automos.results.run_files import RunFiles

Kinds = Callable[[npt.NDArray[np.int64]], npt.NDArray[np.int64]]
"""Takes numbers of tracks and returns an index into `KINDS` for each."""
KINDS = ("Vehicle", "Pedestrian", "Cyclist")
_PERSON, _TWO_WHEELER = 1.2, 2.6
"""Metres: the longest side of people walking, and of whoever rides a two-wheeler no wider than a person is long."""


def kinds_of(sizes: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Return (K,) index into `KINDS` of boxes with `sizes` (K, 3): length, width, height in metres."""
    sides = np.asarray(sizes, np.float64).reshape(-1, 3)[:, :2]
    longest, shortest = sides.max(axis=1), sides.min(axis=1)
    return np.select([longest < _PERSON, (longest < _TWO_WHEELER) & (shortest < _PERSON)], [1, 2], 0)


def kinds_of_tracks(run: RunFiles) -> Kinds:
    """Return what gives an index into `KINDS` for each of some numbers of tracks, 0 where there is no such track.

    It goes by the median of a track's boxes: an object is of one kind.
    """
    found = {
        track["id"]: np.median([box["size"] for box in track["boxes"]], axis=0) for track in run.tracks_file["tracks"]
    }
    kinds = np.zeros(max(found, default=0) + 2, np.int64)
    kinds[list(found)] = kinds_of(list(found.values()))
    return lambda ids: np.take(kinds, ids, mode="clip")
