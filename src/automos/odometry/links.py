"""Scans laid on submaps half a second to some seconds before and after them, and how well they lie."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse
from automos.odometry.motion import compensate, step_twists
from automos.odometry.submap import NOISE, Fit, Submap, fit_surfels, make_submap
from automos.odometry.surfels import Surfels
from automos.scan import Pose

Array = npt.NDArray[np.float64]

MIN_MATCHED = 50
"""Surfels on surfaces that a scan and a submap need in common: fewer may all be of one thing that moves."""


@dataclass(frozen=True, eq=False)
class Window:
    """Consecutive scans as surfels, compensated with the motion they were believed to have.

    Attributes
    ----------
    surfels : N surfels, sensor frame mid-sweep.
    twists : (N, 6) motion per sweep they were compensated with.
    T_world_sensor : (N, 4, 4).
    gaps : (N - 1,) time between scans in units of the usual one.
    period : seconds, the usual time between scans.
    share : sweep duration over the usual time between scans.
    """

    surfels: list[Surfels]
    twists: Array
    T_world_sensor: Pose
    gaps: Array
    period: float
    share: float

    def __len__(self) -> int:
        return len(self.surfels)

    @property
    def clock(self) -> Array:
        """(N,) seconds since the first scan."""
        return np.concatenate([[0.0], np.cumsum(self.gaps)]) * self.period

    def moved(self, T_world_sensor: Pose) -> Window:
        """Return the same scans at other poses, their surfels compensated for the motion these imply."""
        twists = self.share * step_twists(T_world_sensor, self.gaps)
        pieces = zip(self.surfels, twists - self.twists, strict=True)
        surfels = [Surfels(compensate(s.mean, s.time, change), s.covariance, s.count, s.time) for s, change in pieces]
        return Window(surfels, twists, T_world_sensor, self.gaps, self.period, self.share)


@dataclass(frozen=True)
class Alignment:
    """How scans are laid on submaps.

    Attributes
    ----------
    kernels : metres, one round each: residuals much longer count little.
    noise : metres, deviation of a surfel on a perfect surface.
    lags : seconds between a scan and the submaps it is laid on.
    submap_every : seconds between the middles of submaps.
    submap_length : seconds of scans in a submap.
    max_distance : metres between a scan and the submaps it is laid on: farther away too little is seen of the same.
    max_surfels : of a scan that are laid on one submap, at most; more cost time and tell nothing new.
    """

    kernels: tuple[float, ...] = (0.5, 0.2, 0.1, 0.1)
    noise: float = NOISE
    lags: tuple[float, ...] = (0.5, 1.0, 2.0)
    submap_every: float = 0.5
    submap_length: float = 0.3
    max_distance: float = 25.0
    max_surfels: int = 2500


COARSE = Alignment((0.2, 0.2), noise=0.05, submap_every=0.3, submap_length=0.5, max_distance=40.0, max_surfels=800)
"""Under which hypotheses are compared: wide enough not to overlook what does not fit."""


@dataclass(frozen=True, eq=False)
class Consistency:
    """How well scans lie on what other scans saw, one row per link of a scan with a submap.

    Attributes
    ----------
    lag : (L,) seconds between scan and submap, absolute.
    distance : (L,) metres between them.
    thickness : (L,) metres, how far surfels lie off the surfaces they meet (root of the robust mean square).
    disagreement : (L,) metres by which the link alone would move the scan.
    share : (L,) of the surfels laid down, those that met a surface and lie on it.
    """

    lag: Array
    distance: Array
    thickness: Array
    disagreement: Array
    share: Array

    @property
    def misfit(self) -> float | None:
        """How badly scans fold: the logarithm of how thick walls are over how much finds a wall; None without links."""
        return float(np.log(np.median(self.thickness) / np.median(self.share))) if len(self.share) else None

    @staticmethod
    def concatenate(parts: list[Consistency]) -> Consistency:
        """Return the links of all `parts`."""
        names = ("lag", "distance", "thickness", "disagreement", "share")
        return Consistency(*(np.concatenate([getattr(p, name) for p in parts] or [np.zeros(0)]) for name in names))


def choose_links(window: Window, about: Alignment) -> Iterator[tuple[int, int]]:
    """Yield (scan, middle scan of a submap): for each lag the submaps nearest to it, before and after."""
    half, every = _half_width(window, about), max(round(about.submap_every / window.period), 1)
    n = len(window)
    centers = np.arange(min(half, n - 1), max(n - half, min(half, n - 1) + 1), every)
    position = window.T_world_sensor[:, :3, 3]
    for i in range(n):
        chosen = set()
        for lag in about.lags:
            for sign in (-1, 1):
                wanted = i + sign * max(round(lag / window.period), 1)
                center = int(centers[np.argmin(np.abs(centers - wanted))])
                is_apart = abs(center - i) > half
                is_near = np.linalg.norm(position[center] - position[i]) < about.max_distance
                if is_apart and is_near and abs(center - wanted) <= every:
                    chosen.add(center)
        yield from ((i, center) for center in sorted(chosen))


def _half_width(window: Window, about: Alignment) -> int:
    """Return the number of scans on either side of a submap's middle one; few scans make narrow submaps."""
    return min(int(about.submap_length / window.period / 2.0), max(len(window) - 2, 0) // 3)


def _make_submaps(
    window: Window, centers: Iterable[int], about: Alignment, pool: ThreadPoolExecutor | None
) -> dict[int, Submap]:
    """Return the submaps around the scans `centers`."""
    half = _half_width(window, about)
    T = window.T_world_sensor

    def make(center: int) -> tuple[int, Submap]:
        first, last = max(center - half, 0), min(center + half + 1, len(window))
        T_center_parts = inverse(T[center]) @ T[first:last]
        return center, make_submap(window.surfels[first:last], T_center_parts)

    return dict(_map(pool, make, list(centers)))


def fit_links(
    window: Window,
    links: list[tuple[int, int]],
    kernel: float,
    about: Alignment,
    pool: ThreadPoolExecutor | None,
) -> tuple[list[Fit], Consistency]:
    """Return how the scans lie on the submaps, one fit for each of `links` (from `choose_links`), and the figures."""
    T = window.T_world_sensor
    submaps = _make_submaps(window, sorted({center for _, center in links}), about, pool)

    T_center_scan = inverse(T[[center for _, center in links]]) @ T[[i for i, _ in links]]

    def fit(k: int) -> Fit:
        i, center = links[k]
        surfels = window.surfels[i]
        every = max(-(-len(surfels) // about.max_surfels), 1)  # another part for each link: all have a say
        return fit_surfels(submaps[center], surfels[k % every :: every], T_center_scan[k], kernel, about.noise)

    fits = _map(pool, fit, list(range(len(links))))
    clock = np.concatenate([[0.0], np.cumsum(window.gaps)]) * window.period
    kept = [(link, f) for link, f in zip(links, fits, strict=True) if f.n_matched >= MIN_MATCHED]
    if not kept:
        return fits, Consistency.concatenate([])
    ids = np.array([link for link, _ in kept])
    solved = np.array([np.linalg.solve(f.H + 1e-6 * np.trace(f.H) * np.eye(6), f.g)[:3] for _, f in kept])
    return fits, Consistency(
        lag=np.abs(clock[ids[:, 0]] - clock[ids[:, 1]]),
        distance=np.linalg.norm(T[ids[:, 0], :3, 3] - T[ids[:, 1], :3, 3], axis=1),
        thickness=np.array([f.thickness for _, f in kept]),
        disagreement=np.linalg.norm(solved, axis=1),
        share=np.array([f.n_close / f.n_surfels for _, f in kept]),
    )


def _map(pool: ThreadPoolExecutor | None, function: Callable, items: list) -> list:
    return list(pool.map(function, items)) if pool is not None else [function(item) for item in items]
