"""Short windows in which the sensor moves, and the hypothesis on the sweep timing under which they align best."""

from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache, partial

import numpy as np

from automos.core.geometry import Array, inverse, se3_log
from automos.core.scan import Pose, Scan, Sequence
from automos.odometry.clock import Clock
from automos.odometry.links import COARSE, MIN_MATCHED, Links
from automos.odometry.motion import step_twists
from automos.odometry.refine import align
from automos.odometry.submap import CLOSE
from automos.odometry.surfels import NEAR, Surfels, scan_surfels
from automos.odometry.sweep_timing import SweepTiming, azimuth_times
from automos.odometry.window import Window
from automos.settings import OdometrySettings

WINDOWS = 2
"""Windows, at most, if the recording gives times or an order of its points: where all show the same traffic, more of
them do not help."""
WINDOW_SCANS = 16
"""Scans per window: enough for a full turn of a seam that drifts by a tenth of a turn per scan."""
GAIN = 0.01
"""By which the misfit, a logarithm, must be less than that of the first hypothesis. A wrong timing makes walls thicker
by as much as the right one makes them thinner, so the sign of the difference decides, however uncertain it is."""
N_ERRORS = 1.5
"""Standard errors by which a hypothesis must be better than an assumed one, or where the same scans selected it among
many: the best of ten without any merit is ahead by as much. If it is ahead of every hypothesis of another kind
by so many, no more windows are needed."""


BySource = dict[str, Window]
"""N consecutive scans at rough poses, of points compensated with the times of each source."""


def moving_windows(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose,
    clock: Clock,
    from_points: list[SweepTiming],
    pool: ThreadPoolExecutor | None,
) -> Iterator[BySource]:
    """Yield the windows of the recording in which the sensor moves, starting from the middle.

    `from_points` : timings that need the points of a whole scan, at most one of each source.
    """
    each: Callable = map if pool is None else pool.map
    length = min(WINDOW_SCANS, len(sequence))
    if length < WINDOW_SCANS // 2:
        return
    n_places = max(round(len(sequence) / length), 1)
    places = np.linspace(0, len(sequence) - length, n_places).round().astype(int)
    for first in places[np.argsort(np.abs(places - places.mean()), kind="stable")].tolist():
        if bend_of(poses[first : first + length]) < CLOSE:  # less than inliers are off
            continue
        scans = [sequence[i] for i in range(first, first + length)]
        at_rest = np.zeros((length, 6))
        surfels = _surfels_of(scans, at_rest, SweepTiming(), settings, each)
        gaps = clock.gaps[first : first + length - 1]
        rough = Window(surfels, at_rest, poses[first : first + length], gaps, clock.period, 0.0)
        by_source = {"none": rough}
        for timing in from_points:
            twists = timing.share * step_twists(rough.T_world_sensor, gaps)
            timed = _surfels_of(scans, twists, timing, settings, each)
            by_source[timing.source] = replace(rough, surfels=timed, twists=twists)
        yield by_source


def bend_of(T_world_sensor: Pose) -> float:
    """Return by how many metres the motion between neighbouring scans distorts a sweep, on average."""
    travelled, turned = np.split(se3_log(inverse(T_world_sensor[:-1]) @ T_world_sensor[1:]), 2, axis=1)
    bends = np.linalg.norm(travelled, axis=1) + NEAR * np.linalg.norm(turned, axis=1)
    return float(bends.mean()) if len(bends) else 0.0


def _surfels_of(
    scans: list[Scan], twists: Array, timing: SweepTiming, settings: OdometrySettings, each: Callable
) -> list[Surfels]:
    """Return the surfels of N scans, compensated for `twists` (N, 6) with the times of `timing`."""
    return list(each(partial(scan_surfels, timing=timing, settings=settings), scans, twists))


def measure_misfits(guess: SweepTiming, window: BySource, is_rough: bool, settings: OdometrySettings) -> Array:
    """Return (L,) the misfit of each link of the window after its poses are re-estimated under the guess.

    A misfit is the logarithm of the wall thickness over the matched share; NaN without enough; `is_rough` takes half.

    Equation: misfit
    """
    timed = window["none" if guess.has_fixed_seam else guess.source]
    if guess.has_fixed_seam:  # which gives surfels their times; those of other sources have theirs from the points
        times = partial(azimuth_times, turn=guess.turn, seam_deg=guess.seam_deg or 0.0)
        timed = replace(timed, surfels=[replace(s, time=times(s.mean), sparse=None) for s in timed.surfels])
    timed = replace(timed, share=guess.share).moved(timed.T_world_sensor)
    links = Links(COARSE)
    chosen = links.choose(timed)
    aligned = align(timed, settings, links, kernels=COARSE.kernels[: 1 if is_rough else None])[0]
    fits = links.fit(aligned, chosen, COARSE.kernels[-1])
    n_close = np.array([fit.n_close if fit.n_matched >= MIN_MATCHED else 0 for fit in fits])
    share = np.where(n_close > 0, n_close / np.array([max(fit.n_surfels, 1) for fit in fits]), np.nan)
    return np.log(np.array([fit.thickness for fit in fits]) / share)


def _mean_misfit(misfits: Array) -> Array:
    """Return the mean misfit of links (..., L), in which those without enough matches count as a bad fit."""
    return np.where(np.isfinite(misfits), misfits, 0.0).sum(axis=-1) / max(misfits.shape[-1], 1)


class Search:
    """Evaluates every hypothesis once in every window."""

    def __init__(self, settings: OdometrySettings, pool: ThreadPoolExecutor | None):
        self._map: Callable = map if pool is None else pool.map
        self.windows: list[BySource] = []
        self._measure = cache(lambda guess, k, rough: measure_misfits(guess, self.windows[k], rough, settings))
        self.misfits: dict[str, float] = {}  # see `TimingChoice`
        self.is_clear = False  # whether all hypotheses of another kind than the best are worse, or no different

    def add(self, window: BySource) -> None:
        """Add a window to the evaluation."""
        self.windows.append(window)
        self.misfits, self.is_clear = {}, True

    def _evaluate(self, guesses: list[SweepTiming], is_rough: bool) -> Array:
        """Return (G, L) misfits of the links of all windows."""
        tasks = [(guess, k, is_rough) for k in range(len(self.windows)) for guess in guesses]
        found = list(self._map(self._measure, *zip(*tasks, strict=True)))
        n = len(guesses)
        return np.hstack([np.array(found[k : k + n]) for k in range(0, len(found), n)])

    def likeliest(self, guesses: list[SweepTiming], n: int) -> list[SweepTiming]:
        """Return the `n` of `guesses` under which the windows align best with their current poses, in their order."""
        found = _mean_misfit(self._evaluate(guesses, is_rough=True))
        return [guesses[i] for i in sorted(np.argsort(found, kind="stable")[:n])]

    def is_ahead(self, guess: SweepTiming, assumed: SweepTiming) -> bool:
        """Return whether the windows align clearly better under `guess`."""
        found = self._evaluate([guess, assumed], is_rough=False)
        more, error = _compare(found, found[0])
        return bool(more[1] > N_ERRORS * error[1])

    def best(self, likely: list[SweepTiming], selected: Collection[SweepTiming] = ()) -> SweepTiming | None:
        """Return the hypothesis under which the windows align best; None without hypotheses or with too few matches.

        This is the first one unless another is better; by more (`N_ERRORS`) if it was `selected` among many.
        """
        guesses = [*likely, *selected]
        if not guesses:
            return None
        found = self._evaluate(guesses, is_rough=False)
        if np.isfinite(found).sum(axis=1).max() < WINDOW_SCANS // 2:  # links that match enough surfaces
            self.is_clear = False
            return None
        mean, error = _compare(found, found[0])
        is_selected = np.arange(len(guesses)) >= len(likely)
        score = mean + np.maximum(N_ERRORS * error * is_selected, GAIN)
        score[0] = 0.0
        best = int(np.nanargmin(score))
        named = {str(guess): float(value) for guess, value in zip(guesses, mean, strict=True) if np.isfinite(value)}
        base = next((self.misfits[name] - value for name, value in named.items() if name in self.misfits), 0.0)
        self.misfits = {name: base + value for name, value in named.items()} | self.misfits
        more, error = _compare(found, found[best])
        kinds = [(guess.source, guess.share) for guess in guesses]
        is_other = np.array([kind != kinds[best] for kind in kinds]) & np.isfinite(more)
        more, error = more[is_other], error[is_other]
        self.is_clear &= bool(((np.abs(more) + N_ERRORS * error < GAIN) | (more > N_ERRORS * error)).all())
        return guesses[best]


def _compare(found: Array, best: Array) -> tuple[Array, Array]:
    """Return the mean increase (G,) of the misfits and its standard errors, from misfits (G, L) and (L,).

    Each link is compared with itself, since links differ more than hypotheses; the errors of those of one scan are
    correlated. NaN if nothing is matched.
    """
    more = np.ma.masked_invalid(found - best)
    error = more.std(axis=1) / np.sqrt(more.count(axis=1) / (2 * len(COARSE.lags)))
    return more.mean(axis=1).filled(np.nan), error.filled(np.nan)
