"""Alignment of scans with submaps up to a few seconds before and after them, and how thick walls are then."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from automos.core.geometry import Array, inverse
from automos.core.scan import Pose, Sequence
from automos.odometry.motion import step_twists
from automos.odometry.submap import NOISE, Fit, Submap, fit_surfels, make_submap
from automos.odometry.surfels import Surfels, scan_surfels
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

MIN_MATCHED = 50
"""Surfels of a scan on surfaces of a submap, at least: fewer may all belong to one moving object."""
SAMPLES, SAMPLE_SECONDS = 3, 2.5
"""Parts of a recording in which poses are checked, and the length of each."""
MIN_BASELINE = 0.1
"""Metres over which a disagreement is given in percent; shorter ones are a standing sensor's."""


@dataclass(frozen=True, eq=False)
class Window:
    """N consecutive scans as surfels, compensated with an assumed motion."""

    surfels: list[Surfels]  # sensor frame at mid-sweep
    twists: Array  # (N, 6) motion per sweep used for the compensation
    T_world_sensor: Pose  # (N, 4, 4)
    gaps: Array  # (N - 1,) time between scans in units of the usual one
    period: float  # seconds, the usual time between scans
    share: float  # sweep duration over the usual time between scans

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
        changes = zip(self.surfels, twists - self.twists, strict=True)
        surfels = [of_scan.compensated(change) for of_scan, change in changes]
        return replace(self, surfels=surfels, twists=twists, T_world_sensor=T_world_sensor)


@dataclass(frozen=True)
class Alignment:
    """Parameters for aligning scans with submaps."""

    kernels: tuple[float, ...] = (0.5, 0.2, 0.1, 0.1)  # m, one per iteration: much larger residuals have little weight
    noise: float = NOISE  # m, deviation of a surfel on a perfect surface
    lags: tuple[float, ...] = (0.5, 1.0, 2.0)  # s between a scan and its submaps
    submap_every: float = 0.5  # s between the middles of submaps
    submap_length: float = 0.3  # s of scans in a submap
    max_distance: float = 25.0  # m between a scan and its submaps, at most: beyond it, they have too little in common
    max_surfels: int = 2500  # of a scan aligned with one submap; more take time without further information


COARSE = Alignment((0.2, 0.2), noise=0.05, submap_every=0.3, submap_length=0.5, max_distance=40.0, max_surfels=800)
"""For comparing hypotheses: wide enough not to miss misaligned surfaces."""


class Consistency(NamedTuple):
    """How well scans align with other scans, one row per link of a scan with a submap.

    Equation: misfit
    """

    lag: Array  # (L,) seconds between scan and submap
    thickness: Array  # (L,) metres, distance of surfels from the surfaces they match (root of the robust mean square)
    disagreement: Array  # (L,) metres by which the link alone would move the scan
    share: Array  # (L,) of the surfels that match a surface and lie on it
    distance: Array  # (L,) metres between the scan and the middle of the submap

    @property
    def misfit(self) -> float | None:
        """Logarithm of the wall thickness over the share of surfels that match, both medians; None without links."""
        return float(np.log(np.median(self.thickness) / np.median(self.share))) if len(self.share) else None

    @classmethod
    def concatenate(cls, parts: list[Consistency]) -> Consistency:
        """Return the links of all `parts`, at least one."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


def choose_links(window: Window, about: Alignment) -> Iterator[tuple[int, int]]:
    """Yield (scan, middle scan of a submap): for each lag, the nearest submaps before and after."""
    half, every = half_width(window, about), max(round(about.submap_every / window.period), 1)
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


def half_width(window: Window, about: Alignment) -> int:
    """Return the number of scans on either side of a submap's middle scan."""
    return min(int(about.submap_length / window.period / 2.0), max(len(window) - 2, 0) // 3)


def submap_around(window: Window, center: int, half: int) -> Submap:
    """Return the submap of scan `center` and `half` scans on either side of it."""
    around = slice(max(center - half, 0), center + half + 1)
    return make_submap(window.surfels[around], inverse(window.T_world_sensor[center]) @ window.T_world_sensor[around])


def fit_links(
    window: Window,
    links: list[tuple[int, int]],
    kernel: float,
    about: Alignment,
    pool: ThreadPoolExecutor | None,
    submaps: Mapping[int, Submap] | None = None,
    with_elevation: bool = False,
) -> tuple[list[Fit], Consistency]:
    """Return the fit of each of `links` (from `choose_links`), and their consistency.

    submaps : optional, those of the links' middle scans; made of the window if not given.
    with_elevation : whether the fits have the elevation of the beams as a seventh unknown.
    """
    T, clock = window.T_world_sensor, window.clock
    each: Callable = map if pool is None else pool.map
    if submaps is None:
        make = partial(submap_around, window, half=half_width(window, about))
        centers = sorted({center for _, center in links})
        submaps = dict(zip(centers, each(make, centers), strict=True))
    ids = np.array(links, int).reshape(-1, 2)
    T_center_scan = inverse(T[ids[:, 1]]) @ T[ids[:, 0]]

    def fit(k: int) -> Fit:
        i, center = links[k]
        surfels = window.surfels[i]
        every = max(-(-len(surfels) // about.max_surfels), 1)  # a different subset for each link
        return fit_surfels(
            submaps[center], surfels[k % every :: every], T_center_scan[k], kernel, about.noise, with_elevation
        )

    fits = list(each(fit, range(len(links))))
    kept = [k for k, f in enumerate(fits) if f.n_matched >= MIN_MATCHED]
    good, (scan, center) = [fits[k] for k in kept], ids[kept].T
    solved = [np.linalg.solve(f.H + 1e-6 * np.trace(f.H) * np.eye(len(f.H)), f.g)[:3] for f in good]
    return fits, Consistency(
        lag=np.abs(clock[scan] - clock[center]),
        thickness=np.array([f.thickness for f in good]),
        disagreement=np.linalg.norm(np.reshape(solved, (-1, 3)), axis=1),
        share=np.array([f.n_close / f.n_surfels for f in good]),
        distance=np.linalg.norm(T[scan, :3, 3] - T[center, :3, 3], axis=1),
    )


def measure_consistency(
    sequence: Sequence, poses: Pose, timing: SweepTiming, gaps: Array, period: float, settings: OdometrySettings
) -> Consistency:
    """Return how well scans align with `poses` (N, 4, 4), in a few parts of the recording."""
    length = min(max(round(SAMPLE_SECONDS / period), 3), len(sequence))
    twists = timing.share * step_twists(poses, gaps)
    parts, about = [], Alignment()
    for first in np.unique(np.linspace(0, len(sequence) - length, SAMPLES).round().astype(int)).tolist():
        part = slice(first, first + length)
        surfels = [scan_surfels(sequence[i], twists[i], timing, settings) for i in range(first, first + length)]
        part_gaps = gaps[first : first + length - 1]
        window = Window(surfels, twists[part], poses[part], part_gaps, period, timing.share)
        parts.append(fit_links(window, list(choose_links(window, about)), about.kernels[-1], about, None)[1])
    return Consistency.concatenate(parts)


def summarize(links: Consistency) -> dict[str, float | None]:
    """Return the figures over baselines of about a second; None if there are no such baselines.

    wall_thickness_m : distance of surfels from surfaces observed a second before or after.
    baseline_disagreement_m : correction of a scan that a baseline of a second alone would make.
    baseline_disagreement_percent : the same in percent of the baseline's length; 0 at standstill.
    """
    is_second = (links.lag > 0.6) & (links.lag < 1.5)
    names = ("wall_thickness_m", "baseline_disagreement_m", "baseline_disagreement_percent")
    if not is_second.any():
        return dict.fromkeys(names)
    measured = (links.thickness, links.disagreement, links.distance)
    walls, off, along = (float(np.median(of[is_second])) for of in measured)
    return dict(zip(names, (walls, off, 100.0 * off / along if along > MIN_BASELINE else 0.0), strict=True))
