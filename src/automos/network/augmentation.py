"""Other views of the same moment: turned, mirrored, shifted, thinned.

Everything is done to points and poses of a whole window together, before any image is made, so residuals stay what the
changed world would give; LMNet's own code changes the range image alone and leaves the residuals of the old world.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import Array, inverse, transform
from automos.network.images import Window

SEED = 0
"""Of all that is drawn in a training: which scans, how they are changed, the first weights."""

_MIRRORED, _SHIFTED, _THINNED, _WITHOUT_INTENSITY = 0.5, 0.5, 0.5, 0.3
"""How often; every window is turned. None of them changes a label, all were seen on some robot."""

_MOST_SHIFTED = np.array([2.0, 2.0, 0.3])
"""Metres along x, y, z: other lanes, and mounts as high as on a car or a van."""

_MOST_DROPPED = 0.5
"""Share of a scan's points."""


@dataclass(frozen=True, eq=False)
class Change:
    """What is done to one window.

    Attributes
    ----------
    T : (4, 4) rigid or mirroring, applied in every scan's sensor frame.
    dropped : share of points taken out of every scan.
    keeps_intensity : whether intensities stay.
    """

    T: Array
    dropped: float
    keeps_intensity: bool


UNCHANGED = Change(np.eye(4), 0.0, True)


def draw_change(rng: np.random.Generator, width: int) -> Change:
    """Return a random change. Turns are by whole columns of an image `width` wide, so beams keep to their pixels."""
    T = np.eye(4)
    rng.random()  # as when turns were drawn, too: trainings of before can be repeated
    angle = 2.0 * np.pi * rng.integers(width) / width
    T[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    if rng.random() < _MIRRORED:
        T[1] *= -1.0
    if rng.random() < _SHIFTED:
        T[:3, 3] = rng.uniform(-_MOST_SHIFTED, _MOST_SHIFTED)
    dropped = rng.uniform(0.0, _MOST_DROPPED) if rng.random() < _THINNED else 0.0
    return Change(T, dropped, rng.random() >= _WITHOUT_INTENSITY)


def apply_change(
    window: Window, change: Change, rng: np.random.Generator
) -> tuple[Window, npt.NDArray[np.int64] | slice]:
    """Return the changed window and which rows of its present points stayed."""
    rows = _survivors(len(window.points), change.dropped, rng)
    past = tuple(
        None if points is None else transform(change.T, points[_survivors(len(points), change.dropped, rng)])
        for points in window.past
    )
    intensity = window.intensity[rows] if window.intensity is not None and change.keeps_intensity else None
    T_now_past = change.T @ window.T_now_past @ inverse(change.T)
    return replace(
        window,
        points=transform(change.T, window.points[rows]),
        intensity=intensity,
        past=past,
        T_now_past=T_now_past,
    ), rows


def _survivors(n: int, dropped: float, rng: np.random.Generator) -> npt.NDArray[np.int64] | slice:
    return slice(None) if dropped == 0.0 else np.flatnonzero(rng.random(n) >= dropped)
