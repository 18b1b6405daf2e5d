"""Other views of the same moment: tilted, mirrored, shifted; by a sensor that sees less and measures worse.

Everything is done to points and poses of a whole window together, before any image is made, so residuals stay what the
changed world would give; LMNet's own code changes the range image alone and leaves the residuals of the old world.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse, se3_exp, transform
from automos.core.scan import Points, Pose
from automos.network.images import Window
from automos.network.projection import ImageGrid, project

_TILTED, _MIRRORED, _SHIFTED, _THINNED, _BLIND, _WORN = 0.5, 0.5, 0.5, 0.5, 0.3, 0.5
"""How often. None of them changes a label, all were seen on some robot. Turns change no image but its first column."""

_MOST_TILTED = np.radians(2.0)
_MOST_SHIFTED = np.array([2.0, 2.0, 0.3])
"""Metres along x, y, z: other lanes, and mounts as high as on a car or a van."""

_MOST_DROPPED = 0.5
"""Share of a scan's points."""

_MOST_NOISE, _MOST_SPECKS, _MOST_SWAY = 0.03, 0.01, 0.02
"""Metres of noise on a range, share of points, and metres by which the motion between two past scans is wrong."""

_SWAY_TURN = 0.05
"""Radians by which odometry errs in direction for each metre that it errs in place."""


@dataclass(frozen=True, eq=False)
class Change:
    """What is done to one window.

    Attributes
    ----------
    T : (4, 4) float64
        Rigid or mirroring, applied in every scan's sensor frame.
    dropped : float
        Share of points taken out of every scan.
    is_blind : (H, W) bool, optional
        Pixels of which no scan has points; None for none.
    noise : float
        Metres, standard deviation added to every range.
    specks : float
        Share of points that are seen too near, as at edges and in the air.
    sway : float
        Metres and, times _SWAY_TURN, radians by which the motion between two past scans is wrong.
    """

    T: Array
    dropped: float = 0.0
    is_blind: npt.NDArray[np.bool_] | None = None
    noise: float = 0.0
    specks: float = 0.0
    sway: float = 0.0


UNCHANGED = Change(np.eye(4))


def draw_change(rng: np.random.Generator, height: int, width: int) -> Change:
    """Return a random change of what is seen in an image of this size."""
    T = np.eye(4)
    if rng.random() < _TILTED:
        tilts = rng.uniform(-_MOST_TILTED, _MOST_TILTED, 2)
        T = se3_exp(np.array([0.0, 0.0, 0.0, *tilts, 0.0]))
    if rng.random() < _MIRRORED:
        T[1] *= -1.0
    if rng.random() < _SHIFTED:
        T[:3, 3] = rng.uniform(-_MOST_SHIFTED, _MOST_SHIFTED)
    is_worn = rng.random() < _WORN
    return Change(
        T,
        dropped=rng.uniform(0.0, _MOST_DROPPED) if rng.random() < _THINNED else 0.0,
        is_blind=_draw_blind(rng, height, width) if rng.random() < _BLIND else None,
        noise=rng.uniform(0.0, _MOST_NOISE) if is_worn else 0.0,
        specks=rng.uniform(0.0, _MOST_SPECKS) if is_worn else 0.0,
        sway=rng.uniform(0.0, _MOST_SWAY) if is_worn else 0.0,
    )


def apply_change(
    window: Window, change: Change, grid: ImageGrid, rng: np.random.Generator
) -> tuple[Window, npt.NDArray[np.int64]]:
    """Return the changed window and which rows of its present points stayed."""
    rows = _survivors(window.points, change, grid, rng)
    past = tuple(
        None
        if points is None
        else transform(change.T, _measured(points[_survivors(points, change, grid, rng)], change, rng))
        for points in window.past
    )
    T_now_past = change.T @ _swayed(window.T_now_past, change.sway, rng) @ inverse(change.T)
    return replace(
        window,
        points=transform(change.T, _measured(window.points[rows], change, rng)),
        past=past,
        T_now_past=T_now_past,
    ), rows


def _draw_blind(rng: np.random.Generator, height: int, width: int) -> npt.NDArray[np.bool_]:
    """Return (H, W) which pixels a sensor of fewer beams, with some of them broken and a sector covered, is without."""
    every = rng.choice([1, 1, 2, 4])
    is_row_lost = (np.arange(height) + rng.integers(every)) % every > 0
    is_row_lost |= rng.random(height) < rng.uniform(0.0, 0.2)
    sector = np.arange(width) < rng.uniform(0.0, 0.2) * width
    return is_row_lost[:, None] | np.roll(sector, rng.integers(width))[None, :]


def _survivors(points: Points, change: Change, grid: ImageGrid, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    stays = rng.random(len(points)) >= change.dropped
    if change.is_blind is not None:
        stays &= ~change.is_blind.reshape(-1)[np.maximum(project(points, grid)[0], 0)]
    return np.flatnonzero(stays)


def _measured(points: Points, change: Change, rng: np.random.Generator) -> Points:
    """Return the points as a worse sensor measures their ranges."""
    if change.noise == change.specks == 0.0:
        return points
    ranges = np.maximum(np.linalg.norm(points, axis=1), 1e-3)
    factor = 1.0 + change.noise * rng.standard_normal(len(points)) / ranges
    is_speck = rng.random(len(points)) < change.specks
    factor[is_speck] *= rng.uniform(0.3, 1.0, int(is_speck.sum()))
    return (points * factor[:, None]).astype(np.float32)


def _swayed(T_now_past: Pose, sway: float, rng: np.random.Generator) -> Pose:
    """Return the poses of past scans with the errors of an odometry, which grow from scan to scan."""
    if sway == 0.0:
        return T_now_past
    steps = sway * rng.standard_normal((len(T_now_past), 6)) * np.repeat([1.0, _SWAY_TURN], 3)
    return se3_exp(np.cumsum(steps, axis=0)) @ T_now_past
