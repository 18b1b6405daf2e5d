"""Short parts of a recording in which the sensor moves, at which hypotheses about its sweeps can be tried."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.array_sequence import ArraySequence
from automos.geometry import inverse, se3_log
from automos.odometry.clock import Clock, find_missing
from automos.odometry.kiss import Effort
from automos.odometry.motion import SweepTiming, sweep_times
from automos.odometry.register import register_scans
from automos.odometry.speed import chain, lengthen, missing_distance
from automos.odometry.stretch import Stretch
from automos.odometry.surfels import Surfels
from automos.odometry.sweeps import rows_in_range, surfels_of
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
QUICK = Effort(start_convergence=1e-3, max_iterations=50)
"""Registration of a window's surfels: centimetres are left to what follows."""
QUICK_VOXEL = 1.5
"""Metres, voxel of the local map for it."""


@dataclass(frozen=True, eq=False)
class Window:
    """Consecutive scans in which the sensor moves: surfels of the points as they came, for each source of times."""

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
) -> list[Window]:
    """Return the first of a few places of the recording, its middle first, at which the sensor moves."""
    length = min(WINDOW_SCANS, len(sequence))
    if length < WINDOW_SCANS // 2:
        return []
    n_places = min(max(round(len(sequence) / length), 1), PLACES)
    places = np.linspace(0, len(sequence) - length, n_places).round().astype(int)
    starts = places[np.argsort(np.abs(places - places.mean()), kind="stable")].tolist()

    def look(start: int) -> Window | None:
        scans = [sequence[i] for i in range(start, start + length)]
        part = None if poses is None else poses[start : start + length]
        return _moving_window(scans, part, clock.gaps[start : start + length - 1], sources, clock, settings)

    found: list[Window] = []
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
) -> Window | None:
    """Return consecutive `scans` with rough poses, None where the sensor hardly moves."""
    surfels = {name: [_raw_surfels(scan, timing, settings) for scan in scans] for name, timing in sources.items()}
    raw, T = surfels["raw"], poses
    if T is None:
        means = ArraySequence([Scan(s.mean) for s in raw])
        quick = settings.model_copy(update={"voxel": QUICK_VOXEL})
        steps = np.array([r.T_last_this for r in register_scans(means, quick, SweepTiming(), gaps, QUICK)][1:])
        gaps = gaps if clock.has_stamps else find_missing(steps, gaps, clock.period)
        T = chain(np.eye(4), steps)
    if poses is None:
        rough = Stretch(raw, np.zeros((len(scans), 6)), T, gaps, clock.period, 0.0)
        T = lengthen(T, missing_distance(rough, settings))
    twists = se3_log(inverse(T[:-1]) @ T[1:])
    bend = np.linalg.norm(twists[:, :3], axis=1) + NEAR * np.linalg.norm(twists[:, 3:], axis=1)
    if bend.mean() < MIN_BEND:
        return None
    return Window(surfels, T, gaps, clock.period)


def _raw_surfels(scan: Scan, timing: SweepTiming, settings: OdometrySettings) -> Surfels:
    """Return the surfels of a scan's points as they came, with the times of `timing`."""
    rows, times = rows_in_range(scan, settings), sweep_times(scan, timing)
    points = np.take(scan.points, rows, axis=0)
    times = None if times is None else np.take(times, rows)
    return surfels_of(points, times)
