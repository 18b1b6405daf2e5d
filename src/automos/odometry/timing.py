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
from automos.odometry.clock import Clock
from automos.odometry.motion import SweepTiming
from automos.odometry.moving_windows import MovingWindow, measure_misfits, moving_windows
from automos.odometry.sweep_order import learn_drifting_gap, learn_order
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

SEAMS_DEG = (180.0, 0.0, 90.0, -90.0)
"""Azimuths at which sweeps are tried to start, the most usual first: others must be clearly better."""
USUAL_PERIODS = (0.1, 0.05)
"""Seconds in which sensors turn."""
N_LIKELY = 3
"""Of them, looked at closely."""
LINKS_OF_A_SCAN = 4
"""Links of one scan err together."""
LEAST_LINKS = 8
"""Of a window that meet enough surfaces, to tell anything."""
N_ERRORS = 1.5
"""Standard errors by which another hypothesis must be better."""
GAIN = 0.01
"""By which the misfit, a logarithm, must be less than that of the likeliest hypothesis."""
CLEAR_GAIN = 0.03
"""By which more for what is seldom true: halved or reversed sweeps."""


@dataclass(frozen=True)
class TimingChoice:
    """The timing that was taken, and what it was measured against.

    Attributes
    ----------
    timing : the best.
    misfits : of each hypothesis tried, in words, the logarithm of how thick walls are over how much of them is met,
        less that of the first; empty where nothing had to be, or could be, decided.
    """

    timing: SweepTiming
    misfits: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return what was chosen, and by how many percent its rivals are worse, the next best first."""
        best = self.misfits.get(str(self.timing), 0.0)
        rivals = {name: round(100.0 * float(np.expm1(m - best)), 1) for name, m in self.misfits.items()}
        rivals.pop(str(self.timing), None)
        return {"chosen": str(self.timing), "worse_percent": dict(sorted(rivals.items(), key=lambda item: item[1]))}


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
    timed = _recorded_timings(sequence, clock, wanted)
    if wanted in ("file", "order"):
        return TimingChoice(timed[0])
    is_round = _sees_all_round(sequence)
    if wanted == "auto" and not timed and not is_round:
        return TimingChoice(SweepTiming())
    sources: dict[str, SweepTiming] = {"raw": SweepTiming()}
    sources.update({timing.source: timing for timing in timed})
    windows = moving_windows(sequence, settings, poses, clock, sources, pool)
    search = _Search(windows, settings, pool)
    untimed = [] if sequence.is_compensated is False or wanted == "azimuth" else [SweepTiming()]
    if not search.tells:  # nothing bends where nothing moves, or nothing is there to tell
        from_file = [timing for timing in timed if timing.source == "file"]
        return TimingChoice([*from_file, *untimed, *timed, _rear()][0])
    best = search.best([*timed, *untimed], [replace(timing, share=-timing.share) for timing in timed[:1]])
    has_order = any(timing.source == "order" for timing in timed)
    if is_round and not has_order and (best is None or best.source == "none"):
        best = _best_seam(search, sequence, untimed)
    if best is not None and best.source != "none":
        best = search.best([best], [replace(best, share=share * best.share) for share in _shares(best, clock)])
    choice = TimingChoice(best or _rear(), search.misfits)
    _log.info("sweep timing: %s", choice.to_dict())
    return choice


class _Search:
    """Asks every window once for each hypothesis."""

    def __init__(self, windows: list[MovingWindow], settings: OdometrySettings, pool: ThreadPoolExecutor | None):
        self._map: Callable = map if pool is None else pool.map
        measure = functools.cache(measure_misfits)
        self._misfit = lambda guess, k, is_rough: measure(windows[k], guess, settings, is_rough)
        self.misfits: dict[str, float] = {}
        as_they_came = self._map(lambda k: self._misfit(SweepTiming(), k, True), range(len(windows)))
        self._windows = [k for k, found in enumerate(as_they_came) if np.isfinite(found).sum() >= LEAST_LINKS]

    @property
    def tells(self) -> bool:
        """Whether any window has enough to compare hypotheses on."""
        return bool(self._windows)

    def _ask(self, guesses: list[SweepTiming], is_rough: bool) -> npt.NDArray[np.float64]:
        """Return (G, L) misfits of the links of all windows."""
        asked = [(guess, k, is_rough) for guess in guesses for k in self._windows]
        found = list(self._map(lambda one: self._misfit(*one), asked))
        n = len(self._windows)
        return np.array([np.concatenate(found[g * n : (g + 1) * n]) for g in range(len(guesses))])

    def likeliest(self, guesses: list[SweepTiming], n: int) -> list[SweepTiming]:
        """Return the `n` of `guesses` under which the windows fit best as their poses are, in their order."""
        misfits = self._ask(guesses, is_rough=True)
        found = np.where(np.isfinite(misfits), misfits, 0.0).mean(axis=1)  # what meets nothing fits badly
        return [guesses[i] for i in sorted(np.argsort(found, kind="stable")[:n])]

    def best(self, likely: list[SweepTiming], seldom: list[SweepTiming] | None = None) -> SweepTiming | None:
        """Return the hypothesis under which the windows fit best, the first of them unless another is clearly better.

        What is `seldom` true must be better by more. None where there is no hypothesis.
        """
        guesses = [*likely, *(seldom or [])]
        if not guesses:
            return None
        found = self._ask(guesses, is_rough=False)
        better = found - found[0]  # of each link with itself: how well links fit differs more than hypotheses do
        score = np.full(len(guesses), np.inf)
        base = self.misfits.setdefault(str(guesses[0]), 0.0)
        for g, guess in enumerate(guesses):
            known = better[g, np.isfinite(better[g])]
            if len(known) == 0:  # nothing meets anything under it
                continue
            self.misfits.setdefault(str(guess), base + float(known.mean()))
            error = known.std() / np.sqrt(len(known) / LINKS_OF_A_SCAN)
            margin = GAIN if g < len(likely) else GAIN + CLEAR_GAIN
            score[g] = known.mean() + max(margin, N_ERRORS * error)
        score[0] = 0.0
        return guesses[int(np.argmin(score))]


def _best_seam(search: _Search, sequence: Sequence, untimed: list[SweepTiming]) -> SweepTiming | None:
    """Return the best timing that follows from the direction of points alone, or `untimed`."""
    if turn := learn_drifting_gap(sequence):
        return search.best([*untimed, SweepTiming("azimuth", turn=turn, seam_deg=None, share=1.0)])
    circle = [SweepTiming("azimuth", turn=turn, seam_deg=seam, share=1.0) for seam in SEAMS_DEG for turn in (-1, 1)]
    likely = search.likeliest(circle, N_LIKELY)
    if (found := search.best([*untimed, *likely])) == SweepTiming():
        return found
    found = search.best(likely) or _rear()  # where two seams tell no difference, the more usual one
    around = [((found.seam_deg or 0.0) + off + 180.0) % 360.0 - 180.0 for off in (-45.0, 45.0)]
    return search.best([found, *(replace(found, seam_deg=seam) for seam in around)])


def _shares(timing: SweepTiming, clock: Clock) -> list[float]:
    """Return which part of the time between scans a sweep may have taken, if scans were left out."""
    if timing.source == "file":  # its times say how long a sweep takes
        return []
    usual = [period / clock.period for period in USUAL_PERIODS] if clock.has_stamps else []
    return sorted({0.5, *(round(share, 3) for share in usual if share < 0.45)})


def _rear() -> SweepTiming:
    return SweepTiming("azimuth", turn=-1, seam_deg=SEAMS_DEG[0], share=1.0)


def _recorded_timings(sequence: Sequence, clock: Clock, wanted: str) -> list[SweepTiming]:
    """Return the timings that follow from the file's times and from the order of its points, as far as they are wanted.

    Raises
    ------
    InputError
        One of them is asked for, and there is none.
    """
    found = []
    if wanted in ("auto", "file") and (from_file := _file_timing(sequence, clock)):
        found.append(from_file)
    if wanted in ("auto", "order") and (order := learn_order(sequence)):
        found.append(SweepTiming("order", turn=order.turn, share=order.span / order.turns_per_scan, order=order))
    if wanted == "file" and not found:
        raise InputError(f"{sequence.name} has no time per point; set odometry.time to auto, order or none.")
    if wanted == "order" and not found:
        raise InputError(
            f"in {sequence.name} the azimuth does not run on from point to point, so their order tells no time; "
            "set odometry.time to auto, azimuth or none."
        )
    return found


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
