"""Short parts of a recording in which the sensor moves, and how badly they fit under a hypothesis about its sweeps."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_log
from automos.odometry.clock import Clock, find_missing
from automos.odometry.kiss import register_surfels
from automos.odometry.links import COARSE, MIN_MATCHED, Alignment, Window, choose_links, fit_links
from automos.odometry.motion import (
    SweepTiming,
    azimuth_times,
    chain,
    compensate,
    rows_in_range,
    step_twists,
    sweep_times,
)
from automos.odometry.refine import refine_poses
from automos.odometry.speed import lengthen, search_speed
from automos.odometry.surfels import Surfels, surfels_of
from automos.scan import Pose, Scan, Sequence
from automos.settings import OdometrySettings

NEAR = 15.0
"""Metres, distance of typical walls: how much turning bends a sweep compared with driving."""
WINDOWS = 2
"""Places of the recording where hypotheses are tried."""
PLACES = 7
"""Of them, looked at for motion at most."""
WINDOW_SCANS = 16
"""Scans at each: enough for a seam that drifts by a tenth of a turn a scan to come round."""
MIN_BEND = 0.1
"""Metres by which the motion within a sweep must bend it for a place to tell anything."""

ON_NEIGHBOURS = Alignment((0.5, 0.3), noise=0.05, lags=(0.1, 0.2), submap_every=0.1, submap_length=0.0, max_surfels=600)
"""Each scan on its neighbours: takes over whatever the hypothesis changes in their steps, up to half a metre."""
ROUGH = replace(COARSE, kernels=COARSE.kernels[:1])
"""A single round, to find the likeliest of many."""


@dataclass(frozen=True, eq=False)
class MovingWindow:
    """Consecutive scans in which the sensor moves.

    Attributes
    ----------
    surfels : of the points as they came, for each source of times.
    T_world_sensor : (N, 4, 4) rough poses.
    gaps : (N - 1,) time between scans in units of the usual one.
    period : seconds, the usual time between scans.
    """

    surfels: dict[str, list[Surfels]]
    T_world_sensor: Pose
    gaps: npt.NDArray[np.float64]
    period: float


def moving_windows(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None,
    clock: Clock,
    sources: dict[str, SweepTiming],
    pool: ThreadPoolExecutor | None,
) -> list[MovingWindow]:
    """Return the first of a few places of the recording, its middle first, at which the sensor moves."""
    length = min(WINDOW_SCANS, len(sequence))
    if length < WINDOW_SCANS // 2:
        return []
    n_places = min(max(round(len(sequence) / length), 1), PLACES)
    places = np.linspace(0, len(sequence) - length, n_places).round().astype(int)
    starts = places[np.argsort(np.abs(places - places.mean()), kind="stable")].tolist()

    def look(start: int) -> MovingWindow | None:
        scans = [sequence[i] for i in range(start, start + length)]
        part = None if poses is None else poses[start : start + length]
        return _moving_window(scans, part, clock.gaps[start : start + length - 1], sources, clock, settings)

    found: list[MovingWindow] = []
    at = 0
    while len(found) < WINDOWS and at < len(starts):
        wanted = starts[at : at + WINDOWS - len(found)]
        looks = map(look, wanted) if pool is None else pool.map(look, wanted)
        found += [window for window in looks if window is not None]
        at += len(wanted)
    return found


def _moving_window(
    scans: list[Scan],
    poses: Pose | None,
    gaps: npt.NDArray[np.float64],
    sources: dict[str, SweepTiming],
    clock: Clock,
    settings: OdometrySettings,
) -> MovingWindow | None:
    """Return consecutive `scans` with rough poses, None where the sensor hardly moves."""
    surfels = {name: [_raw_surfels(scan, timing, settings) for scan in scans] for name, timing in sources.items()}
    T = poses
    if T is None:
        steps = register_surfels(surfels["raw"], settings, gaps)
        gaps = gaps if clock.has_stamps else find_missing(steps, gaps, clock.period)
        T = chain(np.eye(4), steps)
        rough = Window(surfels["raw"], np.zeros((len(scans), 6)), T, gaps, clock.period, 0.0)
        T = lengthen(T, search_speed(rough, settings).missing)
    twists = se3_log(inverse(T[:-1]) @ T[1:])
    bend = np.linalg.norm(twists[:, :3], axis=1) + NEAR * np.linalg.norm(twists[:, 3:], axis=1)
    return MovingWindow(surfels, T, gaps, clock.period) if bend.mean() >= MIN_BEND else None


def _raw_surfels(scan: Scan, timing: SweepTiming, settings: OdometrySettings) -> Surfels:
    """Return the surfels of a scan's points as they came, with the times of `timing`."""
    rows, times = rows_in_range(scan, settings), sweep_times(scan, timing)
    return surfels_of(np.take(scan.points, rows, axis=0), None if times is None else np.take(times, rows))


def measure_misfits(
    window: MovingWindow, guess: SweepTiming, settings: OdometrySettings, is_rough: bool
) -> npt.NDArray[np.float64]:
    """Return (L,) how badly each link of the window fits once its poses are made anew under the guess.

    A misfit is the logarithm of how thick walls are over how much of them is met; NaN where too little is. `is_rough`:
    neighbours keep their steps, in a third of the time.
    """
    twists = guess.share * step_twists(window.T_world_sensor, window.gaps)
    raw = window.surfels.get(guess.source, window.surfels["raw"])
    surfels = [_timed(s, guess, twist) for s, twist in zip(raw, twists, strict=True)]
    timed = Window(surfels, twists, window.T_world_sensor, window.gaps, window.period, guess.share)
    links = list(choose_links(timed, COARSE))
    is_fixed = np.zeros(len(timed), bool)
    if not is_rough:
        timed = refine_poses(timed, is_fixed, settings, ON_NEIGHBOURS)[0]
    timed = refine_poses(timed, is_fixed, settings, ROUGH if is_rough else COARSE)[0]
    fits = fit_links(timed, links, COARSE.kernels[-1], COARSE, None)[0]
    n_close = np.array([fit.n_close if fit.n_matched >= MIN_MATCHED else 0 for fit in fits])
    share = np.where(n_close > 0, n_close / np.array([max(fit.n_surfels, 1) for fit in fits]), np.nan)
    return np.log(np.array([fit.thickness for fit in fits]) / share)


def _timed(raw: Surfels, guess: SweepTiming, twist: npt.NDArray[np.float64]) -> Surfels:
    """Return surfels of the points as they came, with times as guessed, compensated for `twist` (6,)."""
    if guess.source == "none":
        return raw
    times = azimuth_times(raw.mean, guess.turn, guess.seam_deg) if guess.source == "azimuth" else raw.time
    return Surfels(compensate(raw.mean, times, twist), raw.covariance, raw.count, times)
