"""Alignment of scans with submaps up to a few seconds before and after them, and how thick walls are then."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from automos.core.arrays import some_of
from automos.core.geometry import Array, inverse
from automos.core.parallel import map_in_shares
from automos.core.scan import Pose, Sequence
from automos.odometry.motion import MIN_STEP, step_twists
from automos.odometry.point_order import SAMPLES
from automos.odometry.submap import NOISE, Fit, Submap, fit_surfels, make_submap
from automos.odometry.surfels import NEAR, Surfels, scan_surfels
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.window import Window, is_moved, small_motion
from automos.settings import OdometrySettings

MIN_MATCHED = 15
"""Surfels of a scan on surfaces of a submap, at least: fewer may all belong to one moving object."""


@dataclass(frozen=True)
class Alignment:
    """Parameters for aligning scans with submaps."""

    kernels: tuple[float, ...] = (0.5, 0.2, 0.1)  # m, one per iteration: much larger residuals have little weight
    noise: float = NOISE  # m, deviation of a surfel on a perfect surface
    lags: tuple[float, ...] = (0.5, 1.0, 2.0)  # s between a scan and its submaps
    submap_every: float = 0.2  # s between the middles of submaps
    submap_length: float = 0.3  # s of scans in a submap
    max_distance: float = 2.0 * NEAR  # m between a scan and its submaps, at most: beyond it, nothing is near both
    max_surfels: int = 2500  # of a scan aligned with one submap; more take time without further information
    with_elevation: bool = False  # fits the elevation of the beams as a seventh unknown


COARSE = Alignment(submap_length=0.5, max_surfels=800)
"""For comparing hypotheses, at poses that are rough."""


class Consistency(NamedTuple):
    """How well scans align with other scans, one row per link of a scan with a submap."""

    lag: Array  # (L,) seconds between scan and submap
    thickness: Array  # (L,) metres, distance of surfels from the surfaces they match (root of the robust mean square)
    disagreement: Array  # (L,) metres by which the link alone would move the scan
    distance: Array  # (L,) metres between the scan and the middle of the submap

    @classmethod
    def concatenate(cls, parts: list[Self]) -> Self:
        """Return the links of all `parts`, at least one."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


Ids = npt.NDArray[np.int64]
Link = tuple[int, int]
"""Numbers of a scan, and of the middle scan of a submap, in the recording."""


class _Fitted(NamedTuple):
    T: Pose  # (4, 4) T_center_scan
    fit: Fit


class _LinkFits(NamedTuple):
    submap: Submap
    surfels: Surfels
    by_kernel: dict[float, _Fitted]


class Links:
    """The links of a window that moves along a recording: submaps and fits, kept while the poses that made them agree.

    Most of both are those of the scan before, so that a new scan costs little more than its own links.
    """

    def __init__(self, about: Alignment, pool: ThreadPoolExecutor | None = None):
        """Take threads."""
        self.about = about
        self.work_in(pool)
        self._submaps: dict[int, tuple[Pose, Submap]] = {}  # by middle scan: its parts' poses, and itself
        self._fits: dict[Link, _LinkFits] = {}

    def work_in(self, pool: ThreadPoolExecutor | None) -> None:
        """Share the work among threads from now on."""
        self._each: Callable = map if pool is None else partial(map_in_shares, pool)

    def forget(self, first: int) -> None:
        """Drop what is of scans before number `first`."""
        self._submaps = {center: made for center, made in self._submaps.items() if center >= first}
        self._fits = {link: made for link, made in self._fits.items() if min(link) >= first}

    def choose(self, window: Window, scans: Iterable[int] | None = None) -> list[Link]:
        """Return the links of `scans` (all by default): for each lag, with the nearest submaps before and after.

        Where the path is shorter than a lag, its first submap stands for an earlier one.
        """
        half, every = self.half_width(window), max(round(self.about.submap_every / window.period), 1)
        first, last = window.first, window.first + len(window)
        inside = range(first, max(last - half, first + 1))
        centers = np.array([c for c in inside if c % every == 0 or c == half] or [first])
        lags = [sign * max(round(lag / window.period), 1) for lag in self.about.lags for sign in (-1, 1)]
        scan = np.array(range(first, last) if scans is None else list(scans))[:, None]
        wanted = scan + np.array(lags)
        center = centers[np.argmin(np.abs(centers[:, None, None] - wanted), axis=0)]
        is_there = (np.abs(center - wanted) <= every) | (wanted < first)
        position = window.T_world_sensor[:, :3, 3]
        off = position[center - first] - position[scan - first]
        is_near = np.sqrt((off**2).sum(axis=-1)) < self.about.max_distance
        kept = is_there & is_near & (np.abs(center - scan) > half)
        return sorted(set(zip((scan + 0 * center)[kept].tolist(), center[kept].tolist(), strict=True)))

    def half_width(self, window: Window) -> int:
        """Return the number of scans on either side of a submap's middle scan."""
        return min(int(self.about.submap_length / window.period / 2.0), max(len(window) - 2, 0) // 3)

    def fit(self, window: Window, links: list[Link], kernel: float) -> list[Fit]:
        """Return the fit of each of `links`, to first order where poses have hardly changed since the last one."""
        T = window.T_world_sensor
        self._make_submaps(window, sorted({center for _, center in links}))
        of_links = [self._fits_of(link, window.surfels[link[0] - window.first]) for link in links]
        scan, center = rows_of(links, window)
        T_center_scan = inverse(T[center]) @ T[scan]
        made = {k: known.by_kernel[kernel] for k, known in enumerate(of_links) if kernel in known.by_kernel}
        T_then, T_now = np.array([known.T for known in made.values()]).reshape(-1, 4, 4), T_center_scan[list(made)]
        is_same, change = ~is_moved(T_then, T_now), small_motion(T_then, T_now)
        fits = {k: fit.moved(c) for (k, (_, fit)), c, same in zip(made.items(), change, is_same, strict=True) if same}

        def fit(k: int) -> _Fitted:
            (scan, center), (submap, surfels, _) = links[k], of_links[k]
            every = max(-(-len(surfels) // self.about.max_surfels), 1)  # a different subset for each link
            some = surfels[(scan + center) % every :: every]
            about = kernel, self.about.noise, self.about.with_elevation
            return _Fitted(T_center_scan[k], fit_surfels(submap, some, T_center_scan[k], *about))

        todo = [k for k in range(len(links)) if k not in fits]
        for k, found in zip(todo, self._each(fit, todo), strict=True):
            of_links[k].by_kernel[kernel] = found
            fits[k] = found.fit
        return [fits[k] for k in range(len(links))]

    def _fits_of(self, link: Link, surfels: Surfels) -> _LinkFits:
        """Return the fits of a link of a scan with `surfels`; none if the link has other ones, or another submap."""
        known, submap = self._fits.get(link), self._submaps[link[1]][1]
        if known is None or known.submap is not submap or known.surfels is not surfels:
            known = self._fits[link] = _LinkFits(submap, surfels, {})
        return known

    def _make_submaps(self, window: Window, centers: list[int]) -> None:
        """Make the submaps about the scans `centers` where there are none, or the poses of their parts have changed."""
        half, T = self.half_width(window), window.T_world_sensor
        at = np.array(centers, int) - window.first
        around = [slice(max(k - half, 0), k + half + 1) for k in at.tolist()]
        parts = [T_center @ T[part] for T_center, part in zip(inverse(T[at]), around, strict=True)]
        todo = [k for k, center in enumerate(centers) if self._is_other(center, parts[k])]
        made = self._each(lambda k: make_submap(window.surfels[around[k]], parts[k]), todo)
        self._submaps.update({centers[k]: (parts[k], submap) for k, submap in zip(todo, made, strict=True)})

    def _is_other(self, center: int, parts: Pose) -> bool:
        """Whether the submap about scan `center` was not made of these `parts` (P, 4, 4)."""
        if center not in self._submaps:
            return True
        then = self._submaps[center][0]
        return len(then) < len(parts) or bool(is_moved(then[-len(parts) :], parts).any())


def rows_of(links: list[Link], window: Window) -> Ids:
    """Return (2, L) the rows of the scans, and of the submaps' middle scans, of `links` in the window."""
    return np.array(links, int).reshape(-1, 2).T - window.first


def that_match(links: list[Link], fits: list[Fit], window: Window) -> tuple[Ids, list[Fit]]:
    """Return the rows (see `rows_of`) and fits of the links of scans with submaps that match enough surfels."""
    kept = [k for k, fit in enumerate(fits) if fit.n_matched >= MIN_MATCHED]
    return rows_of([links[k] for k in kept], window), [fits[k] for k in kept]


def share_close(fits: list[Fit]) -> float:
    """Return the share of surfels that lie on a surface, of all `fits`."""
    return sum(fit.n_close for fit in fits) / max(sum(fit.n_surfels for fit in fits), 1)


def consistency_of(window: Window, links: list[Link], fits: list[Fit]) -> Consistency:
    """Return how well scans align under the `fits` of `links`."""
    clock, T = window.clock, window.T_world_sensor
    (scan, center), good = that_match(links, fits, window)
    solved = [np.linalg.solve(f.H + 1e-6 * np.trace(f.H) * np.eye(len(f.H)), f.g)[:3] for f in good]
    return Consistency(
        lag=np.abs(clock[scan] - clock[center]),
        thickness=np.array([f.thickness for f in good]),
        disagreement=np.linalg.norm(np.reshape(solved, (-1, 3)), axis=1),
        distance=np.linalg.norm(T[scan, :3, 3] - T[center, :3, 3], axis=1),
    )


def measure_consistency(
    sequence: Sequence, poses: Pose, timing: SweepTiming, gaps: Array, period: float, settings: OdometrySettings
) -> Consistency:
    """Return how well scans align with `poses` (N, 4, 4), in a few parts of the recording."""
    parts, about = [], Alignment()
    length = min(max(round((max(about.lags) + min(about.lags)) / period), 3), len(sequence))
    twists = timing.share * step_twists(poses, gaps)
    for first in some_of(len(sequence) - length + 1, SAMPLES).tolist():
        part = slice(first, first + length)
        surfels = [scan_surfels(sequence[i], twists[i], timing, settings) for i in range(first, first + length)]
        part_gaps = gaps[first : first + length - 1]
        window = Window(surfels, twists[part], poses[part], part_gaps, period, timing.share)
        links = Links(about)
        chosen = links.choose(window)
        parts.append(consistency_of(window, chosen, links.fit(window, chosen, about.kernels[-1])))
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
    return dict(zip(names, (walls, off, 100.0 * off / along if along > MIN_STEP else 0.0), strict=True))
