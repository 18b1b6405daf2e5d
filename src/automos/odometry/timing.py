"""Finding out when in the sweep each point was measured, where the recording does not say.

Wrongly timed sweeps are bent, and the poses made from them are wrong in a way that suits them: a driver that cuts its
stream every 1.09 turns makes every step 8 % too short, and neighbouring scans agree perfectly. So each hypothesis about
the times is carried through registration anew: a few seconds of scans are laid on their neighbours, then on what was
seen half a second to two apart, and the hypothesis under which walls are thinnest and best met is taken.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.geometry import inverse, se3_log
from automos.odometry.clock import Clock
from automos.odometry.motion import SweepTiming, azimuth_times, compensate, step_twists, sweep_times
from automos.odometry.refine import refine_poses
from automos.odometry.register import register_scans
from automos.odometry.speed import chain, lengthen, missing_distance
from automos.odometry.stretch import Stretch
from automos.odometry.surfels import Surfels, make_surfels
from automos.odometry.sweep_order import learn_drifting_gap, learn_order
from automos.odometry.sweeps import rows_in_range
from automos.scan import ArraySequence, Pose, Scan, Sequence
from automos.settings import OdometrySettings, RefineSettings

_log = logging.getLogger(__name__)

SEAMS_DEG = (180.0, 0.0, 90.0, -90.0)
"""Azimuths at which sweeps are tried to start."""
NEAR = 15.0
"""Metres, distance of typical walls: how much turning bends a sweep compared with driving."""
WINDOWS = 2
"""Places of the recording where hypotheses are tried."""
WINDOW_SCANS = 16
"""Scans at each: enough for a seam that drifts by a tenth of a turn a scan to come round."""
MIN_BEND = 0.3
"""Metres by which the motion within a sweep must bend it for a place to tell anything."""
GAIN = 0.01
"""By which the misfit, a logarithm, must be less than that of the likeliest hypothesis."""
CLEAR_GAIN = 0.03
"""By which more for what is seldom true: halved or reversed sweeps."""
QUICK = {"voxel": 1.5, "max_iterations": 50, "start_convergence": 1e-3, "start_steps": ()}
"""Registration of a window's surfels: centimetres are left to what follows."""
ON_NEIGHBOURS = RefineSettings(
    kernels=(0.5, 0.3), noise=0.05, lags=(0.1, 0.2), submap_every=0.1, submap_length=0.0, max_surfels=600
)
"""Each scan on its neighbours: takes over whatever the hypothesis changes in their steps, up to half a metre."""
ON_SUBMAPS = RefineSettings(kernels=(0.2, 0.2), noise=0.05, submap_length=0.5, max_distance=40.0, max_surfels=1200)
"""Each scan on what was seen half a second to two apart: wide enough not to overlook what does not fit."""


@dataclass(frozen=True)
class TimingChoice:
    """The timing that was taken, and what it was measured against.

    Attributes
    ----------
    timing : the best.
    misfits : of each hypothesis tried, in words, the logarithm of how thick walls are over how much of them is met;
        empty where nothing had to be, or could be, decided.
    """

    timing: SweepTiming
    misfits: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return what was chosen, and by how many percent its rivals are worse, the next best first."""
        best = self.misfits.get(str(self.timing), 0.0)
        rivals = {name: round(100.0 * float(np.expm1(m - best)), 1) for name, m in self.misfits.items()}
        rivals.pop(str(self.timing), None)
        return {"chosen": str(self.timing), "worse_percent": dict(sorted(rivals.items(), key=lambda item: item[1]))}


@dataclass(frozen=True, eq=False)
class _Window:
    """Consecutive scans in which the sensor moves: surfels of the points as they came, for each source of times."""

    surfels: dict[str, list[Surfels]]
    T_world_sensor: Pose
    gaps: npt.NDArray[np.float64]
    period: float


def choose_timing(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None,
    clock: Clock,
    pool: ThreadPoolExecutor | None = None,
) -> TimingChoice:
    """Return how the time of each point within its sweep is known, as `settings.time` asks.

    Raises
    ------
    InputError
        When the file's times are asked for and there are none, or the order of points and it tells nothing.
    """
    wanted = settings.time
    if wanted == "none" or (wanted == "auto" and sequence.is_compensated):
        return TimingChoice(SweepTiming())
    from_file = _file_timing(sequence, clock)
    if wanted == "file":
        if from_file is None:
            raise InputError(f"{sequence.name} has no time per point; set odometry.time to auto, order or none.")
        return TimingChoice(from_file)
    from_order = _order_timing(sequence)
    if wanted == "order":
        if from_order is None:
            raise InputError(
                f"in {sequence.name} the azimuth does not run on from point to point, so their order tells no time; "
                "set odometry.time to auto, azimuth or none."
            )
        return TimingChoice(from_order)
    is_round = _sees_all_round(sequence)
    if wanted == "auto" and from_file is None and from_order is None and not is_round:
        return TimingChoice(SweepTiming())
    known = {"raw": SweepTiming()}
    known.update({t.source: t for t in (from_file, from_order) if t is not None and wanted == "auto"})
    windows = _moving_windows(sequence, settings, poses, clock, known, pool)
    untimed = [] if sequence.is_compensated is False or wanted == "azimuth" else [SweepTiming()]
    timed = [known[source] for source in ("file", "order") if source in known]
    if not windows:  # nothing bends where nothing moves
        return TimingChoice([*timed[:1], *untimed, _rear()][0] if "file" in known or not untimed else untimed[0])
    search = _Search(windows, pool)
    backwards = [replace(timing, share=-timing.share) for timing in timed[:1]]
    best = search.best([*timed, *untimed] if "file" in known else [*untimed, *timed], backwards)
    if is_round and (best is None or best.source == "none"):
        best = _best_seam(search, sequence, untimed)
    if best is not None and best.source != "none":
        best = search.best([best], [replace(best, share=0.5 * best.share)])  # every second scan was left out
    choice = TimingChoice(best or _rear(), search.misfits())
    _log.info("sweep timing: %s", choice.to_dict())
    return choice


class _Search:
    """Asks the windows once for each hypothesis."""

    def __init__(self, windows: list[_Window], pool: ThreadPoolExecutor | None):
        self._windows, self._pool = windows, pool
        self._seen: dict[SweepTiming, float] = {}
        self._misfit = functools.cache(lambda guess, k: _misfit(windows[k], guess))

    def best(
        self, likely: list[SweepTiming], seldom: list[SweepTiming] | None = None, n_windows: int | None = None
    ) -> SweepTiming | None:
        """Return the hypothesis under which the windows fit best, the first of them unless another is clearly better.

        What is `seldom` true must be better by more. None where there is no hypothesis.
        """
        guesses = [*likely, *(seldom or [])]
        if not guesses:
            return None
        ks = range(len(self._windows) if n_windows is None else min(n_windows, len(self._windows)))
        asked = [(guess, k) for guess in guesses for k in ks]
        ask: Callable = map if self._pool is None else self._pool.map
        found = np.reshape(list(ask(lambda pair: self._misfit(*pair), asked)), (len(guesses), len(ks))).mean(axis=1)
        if len(ks) == len(self._windows):
            self._seen.update(zip(guesses, found.tolist(), strict=True))
        found[1:] += GAIN
        found[len(likely) :] += CLEAR_GAIN
        return guesses[int(np.argmin(found))]

    def misfits(self) -> dict[str, float]:
        """Return the misfit of every guess that all windows were asked about."""
        return {str(guess): misfit for guess, misfit in self._seen.items()}


def _best_seam(search: _Search, sequence: Sequence, untimed: list[SweepTiming]) -> SweepTiming | None:
    """Return the best timing that follows from the direction of points alone, or `untimed`."""
    if turn := learn_drifting_gap(sequence):
        return search.best([*untimed, SweepTiming("azimuth", turn=turn, seam_deg=None, share=1.0)])
    circle = [SweepTiming("azimuth", turn=turn, seam_deg=seam, share=1.0) for seam in SEAMS_DEG for turn in (-1, 1)]
    rough = search.best(circle, n_windows=1) or circle[0]
    finer = [replace(rough, seam_deg=((rough.seam_deg or 0.0) + off + 180.0) % 360.0 - 180.0) for off in (-45.0, 45.0)]
    return search.best([*untimed, rough, *finer])


def _rear() -> SweepTiming:
    return SweepTiming("azimuth", turn=-1, seam_deg=SEAMS_DEG[0], share=1.0)


def _order_timing(sequence: Sequence) -> SweepTiming | None:
    order = learn_order(sequence)
    return (
        None
        if order is None
        else SweepTiming("order", turn=order.turn, share=order.span / order.turns_per_scan, order=order)
    )


def _file_timing(sequence: Sequence, clock: Clock) -> SweepTiming | None:
    """Return the timing the scans' own times give, None where they have none."""
    ids = np.unique(np.linspace(0, len(sequence) - 1, 11).round().astype(int))
    scans = [sequence[int(i)] for i in ids]
    spans = [float(np.nanmax(scan.time)) for scan in scans if scan.time is not None and scan.is_valid.any()]
    if not spans or np.median(spans) <= 0.0:
        return None
    duration = float(np.median(spans))
    period = duration if sequence.stamps is None or len(sequence) < 2 else clock.period
    return SweepTiming("file", duration=duration, share=duration / period)


def _sees_all_round(sequence: Sequence) -> bool:
    """Return whether a scan has points in nearly all directions, as a sensor that spins about its z axis has."""
    scan = sequence[len(sequence) // 2]
    x, y = scan.points[scan.is_valid, 0], scan.points[scan.is_valid, 1]
    return len(np.unique(np.floor(np.arctan2(y, x) * (18.0 / np.pi)))) >= 30


def _moving_windows(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None,
    clock: Clock,
    sources: dict[str, SweepTiming],
    pool: ThreadPoolExecutor | None,
) -> list[_Window]:
    """Return the first of a few places of the recording, its middle first, at which the sensor moves."""
    length = min(WINDOW_SCANS, len(sequence))
    if length < WINDOW_SCANS // 2:
        return []
    starts = list(dict.fromkeys(round(f * (len(sequence) - length)) for f in (0.5, 0.2, 0.8, 0.35, 0.65, 0.0, 1.0)))

    def look(start: int) -> _Window | None:
        scans = [sequence[i] for i in range(start, start + length)]
        part = None if poses is None else poses[start : start + length]
        return _moving_window(scans, part, clock.gaps[start : start + length - 1], sources, clock, settings)

    found: list[_Window] = []
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
) -> _Window | None:
    """Return consecutive `scans` with rough poses, None where the sensor hardly moves."""
    surfels = {name: [_raw_surfels(scan, timing, settings) for scan in scans] for name, timing in sources.items()}
    raw, T = surfels["raw"], poses
    if T is None:
        means = ArraySequence([Scan(s.mean) for s in raw])
        quick = settings.model_copy(update=QUICK)
        T = chain(np.eye(4), np.array([r.T_last_this for r in register_scans(means, quick, SweepTiming(), gaps)][1:]))
    twists = se3_log(inverse(T[:-1]) @ T[1:])
    bend = np.linalg.norm(twists[:, :3], axis=1) + NEAR * np.linalg.norm(twists[:, 3:], axis=1)
    if bend.mean() < MIN_BEND:
        return None
    if poses is None:
        rough = Stretch(raw, np.zeros((len(scans), 6)), T, gaps, clock.period, 0.0)
        T = lengthen(T, missing_distance(rough, settings.refinement))
    return _Window(surfels, T, gaps, clock.period)


def _raw_surfels(scan: Scan, timing: SweepTiming, settings: OdometrySettings) -> Surfels:
    """Return the surfels of a scan's points as they came, with the times of `timing`."""
    rows, times = rows_in_range(scan, settings), sweep_times(scan, timing)
    points = np.take(scan.points, rows, axis=0)
    about = ON_SUBMAPS
    times = None if times is None else np.take(times, rows)
    surfels = make_surfels(points, times, about.surfel, about.near, about.max_range)
    return surfels[surfels.count >= about.min_points]


def _misfit(window: _Window, guess: SweepTiming) -> float:
    """Return how badly the window fits together once its poses are made anew under the guess."""
    twists = guess.share * step_twists(window.T_world_sensor, window.gaps)
    raw = window.surfels.get(guess.source, window.surfels["raw"])
    surfels = [_timed(s, guess, twist) for s, twist in zip(raw, twists, strict=True)]
    timed = Stretch(surfels, twists, window.T_world_sensor, window.gaps, window.period, guess.share)
    is_fixed = np.zeros(len(timed), bool)
    return refine_poses(refine_poses(timed, is_fixed, ON_NEIGHBOURS)[0], is_fixed, ON_SUBMAPS)[2].misfit or 0.0


def _timed(raw: Surfels, guess: SweepTiming, twist: npt.NDArray[np.float64]) -> Surfels:
    """Return surfels of the points as they came, with times as guessed, compensated for `twist` (6,)."""
    if guess.source == "none":
        return raw
    times = azimuth_times(raw.mean, guess.turn, guess.seam_deg) if guess.source == "azimuth" else raw.time
    return Surfels(compensate(raw.mean, times, twist), raw.covariance, raw.count, times)
