"""Submaps of the last scans, kept from scan to scan while the poses of their parts agree."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from automos.core.geometry import inverse
from automos.core.scan import Pose
from automos.odometry.links import Alignment, Window, half_width, submap_around
from automos.odometry.refine import CONVERGED
from automos.odometry.submap import Submap

ABOUT = Alignment(kernels=(0.5, 0.2, 0.1), submap_every=0.2)
"""Submaps are cheap, since most are those of the scan before; the more of them, the sooner a path has some."""


class RecentSubmaps:
    """The submaps of a window that slides along a stream."""

    def __init__(self) -> None:
        self._first = 0  # number of the window's first scan in the stream
        self._made: dict[int, tuple[Pose, Submap]] = {}  # by number of the middle scan: its parts' poses, and itself

    def forget(self, n: int) -> None:
        """Move the window by `n` scans."""
        self._first += n
        self._made = {center: made for center, made in self._made.items() if center >= self._first}

    def links(self, window: Window, scans: Iterable[int]) -> list[tuple[int, int]]:
        """Return (scan, middle scan of a submap): for each lag, the nearest submaps before and after.

        Where the path is shorter than a lag, its first submap stands for an earlier one.
        """
        half, every = half_width(window, ABOUT), max(round(ABOUT.submap_every / window.period), 1)
        of_window = range(max(len(window) - half, 1))
        centers = np.array([c for c in of_window if (self._first + c) % every == 0 or self._first + c == half] or [0])
        lags = [sign * max(round(lag / window.period), 1) for lag in ABOUT.lags for sign in (-1, 1)]
        position, links = window.T_world_sensor[:, :3, 3], set()
        for i in scans:
            for lag in lags:
                center = int(centers[np.argmin(np.abs(centers - (i + lag)))])
                is_near = abs(center - (i + lag)) <= every or i + lag < 0
                is_apart = abs(center - i) > half
                if is_near and is_apart and np.linalg.norm(position[center] - position[i]) < ABOUT.max_distance:
                    links.add((i, center))
        return sorted(links)

    def of(self, window: Window, links: list[tuple[int, int]]) -> dict[int, Submap]:
        """Return the submaps of the links' middle scans, made again if their scans moved against each other."""
        half, T, found = half_width(window, ABOUT), window.T_world_sensor, {}
        for center in sorted({center for _, center in links}):
            parts = inverse(T[center]) @ T[max(center - half, 0) : center + half + 1]
            made = self._made.get(self._first + center)
            if made is None or made[0].shape != parts.shape or np.abs(made[0] - parts)[:, :3, 3].max() > CONVERGED:
                made = parts, submap_around(window, center, half)
                self._made[self._first + center] = made
            found[center] = made[1]
        return found
