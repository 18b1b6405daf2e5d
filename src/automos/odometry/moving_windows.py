"""Short parts of a recording in which the sensor moves, at which hypotheses about its sweeps can be tried."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_log
from automos.odometry.clock import Clock, find_missing
from automos.odometry.kiss import register_surfels
from automos.odometry.links import Window
from automos.odometry.motion import SweepTiming, chain, rows_in_range, sweep_times
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
