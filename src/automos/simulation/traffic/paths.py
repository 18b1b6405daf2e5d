"""Paths in the plane: smooth lines with arc length, along which roads run, vehicles drive and people walk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array

Range = tuple[float, float]
"""From the first number to the second."""
STEP = 0.5
"""Metres between the samples of a path."""


def every(rng: np.random.Generator, spacing: Range, start: float, end: float) -> Iterator[float]:
    """Yield numbers from `start` on to before `end`, at random `spacing`."""
    while start < end:
        yield start
        start += rng.uniform(*spacing)


@dataclass(frozen=True, eq=False)
class Path:
    """A line sampled every `STEP` metres.

    Attributes
    ----------
    xy : (K, 2) float64
        Metres.
    z : (K,) float64
        Metres above the terrain's height (0 on the ground, more on a bridge).
    """

    xy: Array
    z: Array

    @property
    def length(self) -> float:
        """Metres."""
        return STEP * (len(self.xy) - 1)

    @cached_property
    def heading(self) -> Array:
        """(K,) radians, continuous."""
        d = np.gradient(self.xy, axis=0)
        return np.unwrap(np.arctan2(d[:, 1], d[:, 0]))

    @property
    def curvature(self) -> Array:
        """(K,) 1/m, positive to the left."""
        return np.gradient(self.heading) / STEP

    def at(self, s: npt.ArrayLike, offset: npt.ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return ((..., 2) position, (...,) heading) at arc length `s`, `offset` metres to the left of the line."""
        s, offset = np.broadcast_arrays(np.asarray(s, np.float64), np.asarray(offset, np.float64))
        k = s / STEP
        grid = np.arange(len(self.xy))
        heading = np.interp(k, grid, self.heading)
        x, y = (np.interp(k, grid, column) for column in self.xy.T)
        return np.stack([x - offset * np.sin(heading), y + offset * np.cos(heading)], axis=-1), heading

    def beside(self, offset: float | Array) -> Path:
        """Return the path `offset` metres to the left (negative: to the right), one for all or (K,) one per sample."""
        shift = np.column_stack([-offset * np.sin(self.heading), offset * np.cos(self.heading)])
        return resample(self.xy + shift, self.z)

    def reversed(self) -> Path:
        """Return the path driven the other way."""
        return Path(self.xy[::-1].copy(), self.z[::-1].copy())

    def shifted(self, start: float, length: float, offset: float) -> Path:
        """Return the path with a change of lane: `offset` metres to the left, from `start` on over `length` metres."""
        s = STEP * np.arange(len(self.xy))
        u = np.clip((s - start) / length, 0.0, 1.0)
        return self.beside(offset * u**3 * (10.0 - 15.0 * u + 6.0 * u**2))


def connect(a0: npt.ArrayLike, a1: npt.ArrayLike, b0: npt.ArrayLike, b1: npt.ArrayLike, radius: float) -> Path:
    """Return the path from `a0` along the line a0-a1, turning by `radius` metres into the line b0-b1, to `b1`.

    Lines that (nearly) continue each other are joined by a straight piece.
    """
    a0, a1, b0, b1 = (np.asarray(p, np.float64) for p in (a0, a1, b0, b1))
    u, v = a1 - a0, b1 - b0
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.05 * np.linalg.norm(u) * np.linalg.norm(v):
        return through([a0, a1, b0, b1], radius)
    w = b0 - a0
    corner = a0 + u * (w[0] * v[1] - w[1] * v[0]) / cross
    return through([a0, corner, b1], radius)


def resample(xy: npt.ArrayLike, z: npt.ArrayLike | None = None) -> Path:
    """Return the path through the dense polyline `xy` (N, 2), sampled anew every STEP metres."""
    xy = np.asarray(xy, np.float64)
    z = np.zeros(len(xy)) if z is None else z
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
    grid = np.arange(0.0, s[-1] + 1e-9, STEP)
    *sampled, height = (np.interp(grid, s, column) for column in (*xy.T, z))
    return Path(np.column_stack(sampled), height)


def through(points: npt.ArrayLike, radius: float = 8.0) -> Path:
    """Return the path along the polyline `points` (P, 2) with its corners rounded to at most `radius` metres.

    Straight pieces are kept exactly, so paths that share a straight piece run on top of each other there.
    """
    points = np.asarray(points, np.float64)
    corners = zip(points[:-2], points[1:-1], points[2:], strict=True)
    arcs = [_fillet(before, corner, after, radius) for before, corner, after in corners]
    return resample(np.concatenate([points[:1], *arcs, points[-1:]]))


def _fillet(before: Array, corner: Array, after: Array, radius: float) -> Array:
    """Return (N, 2) points of the arc that rounds `corner`."""
    a, b = before - corner, after - corner
    length_a, length_b = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    a, b = a / length_a, b / length_b
    half = 0.5 * float(np.arccos(np.clip(a @ b, -1.0, 1.0)))  # half the angle between the legs
    if half > 0.5 * np.pi - 1e-3:
        return corner[None]
    reach = min(radius / np.tan(half), 0.5 * length_a, 0.5 * length_b)
    radius = reach * np.tan(half)
    bisector = (a + b) / np.linalg.norm(a + b)
    center = corner + bisector * radius / np.sin(half)
    start, end = corner + reach * a - center, corner + reach * b - center
    angle = np.arctan2(start[0] * end[1] - start[1] * end[0], start @ end)
    turn = np.linspace(0.0, angle, max(4, int(abs(angle) * radius / 0.25)))
    c, s = np.cos(turn), np.sin(turn)
    return center + np.column_stack([c * start[0] - s * start[1], s * start[0] + c * start[1]])
