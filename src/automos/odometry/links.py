"""Alignment of scans with submaps up to a few seconds before and after them, and its residuals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse
from automos.odometry.motion import compensate, step_twists
from automos.odometry.submap import NOISE, Fit, Submap, fit_surfels, make_submap
from automos.odometry.surfels import Surfels
from automos.scan import Pose

Array = npt.NDArray[np.float64]

MIN_MATCHED = 50
"""Surfels of a scan on surfaces of a submap, at least: fewer may all belong to one moving object."""


@dataclass(frozen=True, eq=False)
class Window:
    """Consecutive scans as surfels, compensated with an assumed motion.

    Attributes
    ----------
    surfels : list of N Surfels, sensor frame at mid-sweep.
    twists : (N, 6) motion per sweep used for the compensation.
    T_world_sensor : (N, 4, 4) float64.
    gaps : (N - 1,) float64, time between scans in units of the usual one.
    period : float, seconds, the usual time between scans.
    share : float, sweep duration over the usual time between scans.
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

    @property
    def steps(self) -> Pose:
        """(N - 1, 4, 4) from each scan to the one before."""
        return inverse(self.T_world_sensor[:-1]) @ self.T_world_sensor[1:]

    def moved(self, T_world_sensor: Pose) -> Window:
        """Return the same scans at other poses, with surfels compensated for the motion between these."""
        twists = self.share * step_twists(T_world_sensor, self.gaps)
        pieces = zip(self.surfels, twists - self.twists, strict=True)
        surfels = [Surfels(compensate(s.mean, s.time, change), s.covariance, s.count, s.time) for s, change in pieces]
        return Window(surfels, twists, T_world_sensor, self.gaps, self.period, self.share)


@dataclass(frozen=True)
class Alignment:
    """Parameters for aligning scans with submaps.

    Attributes
    ----------
    kernels : tuple of float, metres, one per iteration: much larger residuals have little weight.
    noise : float, metres, deviation of a surfel on a perfect surface.
    lags : tuple of float, seconds between a scan and its submaps.
    submap_every : float, seconds between the middles of submaps.
    submap_length : float, seconds of scans in a submap.
    max_distance : float, metres between a scan and its submaps, at most: beyond it, they have too little in common.
    max_surfels : int, surfels of a scan aligned with one submap, at most; more take time without further information.
    """

    kernels: tuple[float, ...] = (0.5, 0.2, 0.1, 0.1)
    noise: float = NOISE
    lags: tuple[float, ...] = (0.5, 1.0, 2.0)
    submap_every: float = 0.5
    submap_length: float = 0.3
    max_distance: float = 25.0
    max_surfels: int = 2500


COARSE = Alignment((0.2, 0.2), noise=0.05, submap_every=0.3, submap_length=0.5, max_distance=40.0, max_surfels=800)
"""For comparing hypotheses: wide enough not to miss misaligned surfaces."""


@dataclass(frozen=True, eq=False)
class Consistency:
    """How well scans align with other scans, one row per link of a scan with a submap.

    Attributes
    ----------
    lag : (L,) seconds between scan and submap, absolute.
    distance : (L,) metres between them.
    thickness : (L,) metres, distance of surfels from the surfaces they match (root of the robust mean square).
    disagreement : (L,) metres by which the link alone would move the scan.
    share : (L,) share of the surfels that match a surface and lie on it.
    """

    lag: Array
    distance: Array
    thickness: Array
    disagreement: Array
    share: Array

    @property
    def misfit(self) -> float | None:
        """Logarithm of the wall thickness over the share of surfels that match, both medians; None without links."""
        return float(np.log(np.median(self.thickness) / np.median(self.share))) if len(self.share) else None

    @classmethod
    def concatenate(cls, parts: list[Consistency]) -> Consistency:
        """Return the links of all `parts`."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts] or [[]]) for f in fields(cls)))


def choose_links(window: Window, about: Alignment) -> Iterator[tuple[int, int]]:
    """Yield (scan, middle scan of a submap): for each lag, the nearest submaps before and after."""
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
    """Return the number of scans on either side of a submap's middle scan; smaller if there are few scans."""
    return min(int(about.submap_length / window.period / 2.0), max(len(window) - 2, 0) // 3)


def fit_links(
    window: Window,
    links: list[tuple[int, int]],
    kernel: float,
    about: Alignment,
    pool: ThreadPoolExecutor | None,
) -> tuple[list[Fit], Consistency]:
    """Return the fit of each of `links` (from `choose_links`), and their consistency."""
    T, clock, half = window.T_world_sensor, window.clock, _half_width(window, about)
    each: Callable = map if pool is None else pool.map

    def make(center: int) -> Submap:
        around = slice(max(center - half, 0), center + half + 1)
        return make_submap(window.surfels[around], inverse(T[center]) @ T[around])

    centers = sorted({center for _, center in links})
    submaps = dict(zip(centers, each(make, centers), strict=True))
    ids = np.array(links, int).reshape(-1, 2)
    T_center_scan = inverse(T[ids[:, 1]]) @ T[ids[:, 0]]

    def fit(k: int) -> Fit:
        i, center = links[k]
        surfels = window.surfels[i]
        every = max(-(-len(surfels) // about.max_surfels), 1)  # a different subset for each link
        return fit_surfels(submaps[center], surfels[k % every :: every], T_center_scan[k], kernel, about.noise)

    fits = list(each(fit, range(len(links))))
    kept = [k for k, f in enumerate(fits) if f.n_matched >= MIN_MATCHED]
    good, (scan, center) = [fits[k] for k in kept], ids[kept].T
    solved = [np.linalg.solve(f.H + 1e-6 * np.trace(f.H) * np.eye(6), f.g)[:3] for f in good]
    return fits, Consistency(
        lag=np.abs(clock[scan] - clock[center]),
        distance=np.linalg.norm(T[scan, :3, 3] - T[center, :3, 3], axis=1),
        thickness=np.array([f.thickness for f in good]),
        disagreement=np.linalg.norm(np.reshape(solved, (-1, 3)), axis=1),
        share=np.array([f.n_close / f.n_surfels for f in good]),
    )
